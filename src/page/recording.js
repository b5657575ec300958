// SPDX-License-Identifier: BSD-3-Clause
// What a run is to the page: pictures of the scene, and curves of every tick.
const NUMBERS = 7;  // of a frame: position, quaternion

const bytes = base64 => Uint8Array.from(atob(base64), c => c.charCodeAt(0)).buffer;
const floats = base64 => new Float32Array(bytes(base64));

/** The last of `count` things whose time is not after t [s]. */
function lastAt(count, time, t) {
  let low = 0, high = count - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (time(middle) <= t) low = middle; else high = middle - 1;
  }
  return low;
}

/** Columns of series.csv: one value a tick. */
class Curves {
  constructor(columns, live) {
    this.live = live;
    this.t = live ? [] : floats(columns.t);
    this.columns = new Map();
    (live ? columns : columns.curves).forEach((c, k) => this.columns.set(c.name, {
      meaning: c.meaning, values: live ? [] : null, k,
      counts: c.counts && new Uint16Array(bytes(c.counts)), least: c.least, step: c.step, value: c.value}));
  }
  get count() { return this.t.length; }
  has(name) { return this.columns.has(name); }
  known(name) {
    const c = this.columns.get(name);
    return c !== undefined && (this.live || c.counts !== undefined || c.value !== null);
  }
  /** Value at tick i; NaN where nobody knows. */
  at(name, i) {
    const c = this.columns.get(name);
    if (!c) return NaN;
    if (this.live) return c.values[i];
    if (!c.counts) return c.value === null ? NaN : c.value;
    return c.counts[i] === 65535 ? NaN : c.least + c.step * c.counts[i];
  }
  /** A live tick. */
  push(t, numbers) {
    this.t.push(t);
    for (const c of this.columns.values()) c.values.push(numbers[c.k]);
  }
  drop(count) {
    this.t.splice(0, count);
    for (const c of this.columns.values()) c.values.splice(0, count);
  }
}

/** One run: its scene, pictures in the order of time, curves. */
class Recording {
  constructor(scene, width, pictures, curves) {
    this.scene = scene;
    this.width = width;
    this.pictures = pictures;
    this.curves = curves;
    this.frameAt = new Map(scene.frames.map((f, k) => [f.name, NUMBERS * k]));
    this.armAt = NUMBERS * scene.frames.length;
    this.scalarAt = new Map(scene.scalars.map((name, k) => [name, this.armAt + 3 * scene.arm.length + k]));
    this.curvesAt = this.armAt + 3 * scene.arm.length + scene.scalars.length;
  }
  static of(data) {
    const numbers = floats(data.pictures), pictures = [];
    for (let i = 0; i < numbers.length; i += data.width) pictures.push(numbers.subarray(i, i + data.width));
    return new Recording(data.scene, data.width, pictures, new Curves(data.columns, false));
  }
  get count() { return this.pictures.length; }
  frame(i, name) {
    const k = this.frameAt.get(name);
    return this.pictures[i].subarray(k, k + NUMBERS);
  }
  /** By which point k of the arm is bent. */
  bent(i, k) { return this.pictures[i].subarray(this.armAt + 3 * k, this.armAt + 3 * k + 3); }
  knows(name) { return this.scalarAt.has(name); }
  scalar(i, name) { return this.knows(name) ? this.pictures[i][this.scalarAt.get(name)] : NaN; }
  vector(i, names) { return new THREE.Vector3(...names.map(name => this.scalar(i, name))); }
  time(i) { return this.scalar(i, 't_s'); }
  /** The last picture not after t [s]. */
  at(t) { return lastAt(this.count, i => this.time(i), t); }
}
