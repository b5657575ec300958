// SPDX-License-Identifier: BSD-3-Clause
'use strict';
// The page places objects where the pictures say; all geometry comes from the program.
(function () {
  const COLOURS = ['#0067a8', '#c14e00', '#00805e'];
  const NUMBERS = 7;  // of a frame: position, quaternion

  class Recording {
    constructor(data) {
      this.scene = data.scene;
      this.width = data.width;
      const bytes = Uint8Array.from(atob(data.pictures), c => c.charCodeAt(0));
      this.numbers = new Float32Array(bytes.buffer);
      this.count = this.numbers.length / this.width;
      this.scalarsAt = NUMBERS * this.scene.frames.length;
    }
    frame(i, name) {
      const k = this.scene.frames.findIndex(f => f.name === name);
      return this.numbers.subarray(i * this.width + NUMBERS * k, i * this.width + NUMBERS * (k + 1));
    }
    scalar(i, name) {
      return this.numbers[i * this.width + this.scalarsAt + this.scene.scalars.indexOf(name)];
    }
    time(i) { return this.scalar(i, 't_s'); }
    /** The last picture not after t [s]. */
    at(t) {
      let low = 0, high = this.count - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (this.time(middle) <= t) low = middle; else high = middle - 1;
      }
      return low;
    }
  }

  /** The bodies of one recording, and of the base in free space beside it. */
  class Bodies {
    constructor(recording, world, look) {
      this.recording = recording;
      this.frames = {'': world};
      this.legs = [];
      this.ghosts = [];
      for (const f of recording.scene.frames) {
        this.frames[f.name] = new THREE.Group();
        this.frames[f.parent].add(this.frames[f.name]);
      }
      // What stands on the platform stands on the base in free space too.
      this.twins = [];
      for (const f of recording.scene.frames)
        if (f.parent === 'platform') {
          const twin = new THREE.Group();
          this.frames.base.add(twin);
          this.twins.push([f.name, twin]);
        }
      const twinOf = name => name === 'platform' ? this.frames.base : (this.twins.find(t => t[0] === name) || [])[1];
      for (const shape of recording.scene.shapes) {
        const mesh = body(shape, look);
        this.frames[shape.frame].add(mesh);
        if ('leg' in shape) this.legs.push([shape.leg, mesh]);
        const twin = twinOf(shape.frame);
        if (twin) twin.add(body(shape, {colour: 0x7a5cc0, opacity: 0.22}));
      }
      this.force = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.1, 0xc1121f, 0.08, 0.05);
      world.add(this.force);
    }
    place(i, ghost, newtonsPerMetre) {
      const r = this.recording;
      const put = (object, name) => {
        const p = r.frame(i, name);
        const known = !isNaN(p[0]);
        object.visible = known;
        if (!known) return;
        object.position.set(p[0], p[1], p[2]);
        object.quaternion.set(p[3], p[4], p[5], p[6]);
      };
      for (const f of r.scene.frames) put(this.frames[f.name], f.name);
      for (const [name, twin] of this.twins) put(twin, name);
      this.frames.base.visible = this.frames.base.visible && ghost;
      for (const [leg, mesh] of this.legs) {
        const margin = Math.max(0, Math.min(1, r.scalar(i, `leg${leg + 1}_margin`)));
        mesh.material.color.setHSL(0.33 * Math.min(1, margin * 2), margin < 0.5 ? 0.6 : 0.12, 0.5);
      }
      const f = new THREE.Vector3(r.scalar(i, 'fx_dynamic'), r.scalar(i, 'fy_dynamic'), r.scalar(i, 'fz_dynamic'));
      const length = f.length() / newtonsPerMetre;
      this.force.visible = length > 0.02 && isFinite(length);
      if (this.force.visible) {
        this.force.position.copy(this.frames.platform.position);
        this.force.setDirection(f.normalize());
        this.force.setLength(Math.min(length, 3), 0.08, 0.05);
      }
    }
  }

  function body(shape, look) {
    const material = new THREE.MeshStandardMaterial({
      color: look.colour || {plate: 0x6b7885, cylinder: 0x8d99a6, capsule: 0xe0903a, axes: 0x333333}[shape.kind],
      transparent: look.opacity < 1, opacity: look.opacity || 1, roughness: 0.6, metalness: 0.1,
      depthWrite: !(look.opacity < 1)});
    const up = new THREE.Vector3(0, 1, 0);  // of three.js's cylinders
    const group = new THREE.Group();
    const add = (geometry, place) => {
      const mesh = new THREE.Mesh(geometry, material);
      if (place) place(mesh);
      group.add(mesh);
    };
    if (shape.kind === 'plate') {
      const outline = new THREE.Shape(shape.corners.map(c => new THREE.Vector2(c[0], c[1])));
      add(new THREE.ExtrudeBufferGeometry(outline, {depth: shape.thickness, bevelEnabled: false}),
          mesh => { mesh.position.z = shape.top - shape.thickness; });
    } else if (shape.kind === 'cylinder') {
      const from = shape.from || [0, 0, 0];
      add(new THREE.CylinderBufferGeometry(shape.radius, shape.radius, Math.abs(shape.length), 20), mesh => {
        mesh.rotation.x = Math.PI / 2;
        mesh.position.set(from[0], from[1], from[2] + shape.length / 2);
      });
    } else if (shape.kind === 'capsule') {
      const a = new THREE.Vector3(...shape.from), b = new THREE.Vector3(...shape.to);
      const way = b.clone().sub(a);
      add(new THREE.CylinderBufferGeometry(shape.radius, shape.radius, way.length(), 20), mesh => {
        mesh.position.copy(a).addScaledVector(way, 0.5);
        mesh.quaternion.setFromUnitVectors(up, way.clone().normalize());
      });
      for (const end of [a, b])
        add(new THREE.SphereBufferGeometry(shape.radius * 1.15, 18, 14), mesh => mesh.position.copy(end));
    } else if (shape.kind === 'axes') {
      group.add(new THREE.AxesHelper(shape.size));
    }
    group.material = material;
    return group;
  }

  const element = id => document.getElementById(id);
  const recordings = window.VES_RECORDINGS.map(data => new Recording(data));
  const first = recordings[0];

  // The scene, z up.
  THREE.Object3D.DefaultUp.set(0, 0, 1);
  const renderer = new THREE.WebGLRenderer({canvas: element('canvas'), antialias: true, preserveDrawingBuffer: true});
  const world = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(38, 1, 0.05, 100);
  const controls = new THREE.OrbitControls(camera, element('canvas'));
  world.add(new THREE.HemisphereLight(0xffffff, 0x777788, 0.75));
  const sun = new THREE.DirectionalLight(0xffffff, 0.6);
  sun.position.set(3, -4, 6);
  world.add(sun);
  const grid = new THREE.GridHelper(6, 24);
  grid.rotation.x = Math.PI / 2;
  world.add(grid);
  const bodies = recordings.map((r, k) => new Bodies(r, world, k ? {colour: 0x3a7ca5, opacity: 0.4} : {}));
  const reach = Math.min(first.scene.reach, 3), middle = 0.8 * first.scene.home + 0.25 * reach;
  function look(view) {
    const far = 2.6 + first.scene.home + 0.7 * reach;
    const from = {iso: [0.62, -0.95, 0.5], front: [0, -1.15, 0.02], side: [1.15, 0, 0.02], top: [0, -0.001, 1.2]}[view];
    camera.position.set(far * from[0], far * from[1], middle + far * from[2]);
    controls.target.set(0, 0, middle);
    controls.update();
  }
  look('iso');

  // Charts: one column of time, one a curve.
  const SHOWN = [
    ['position [mm]', ['x', 'y', 'z'].map(c => [`${c}_actual`, c, 1e3]), ['x', 'y', 'z'].map(c => [`${c}_commanded`, `${c} commanded`, 1e3])],
    ['attitude [deg]', ['alpha', 'beta', 'gamma'].map(c => [`${c}_actual`, c, 180 / Math.PI]), ['alpha', 'beta', 'gamma'].map(c => [`${c}_commanded`, `${c} commanded`, 180 / Math.PI])],
    ['force, gravity taken out [N]', ['fx', 'fy', 'fz'].map(c => [`${c}_dynamic`, c, 1])],
    ['moment [N m]', ['mx', 'my', 'mz'].map(c => [`${c}_dynamic`, c, 1])],
    ['legs, commanded minus measured [mm]', [1, 2, 3, 4, 5, 6].map(i => [`leg${i}_error_m`, `leg ${i}`, 1e3])],
    ['woke late [ms]', [['late_s', 'late', 1e3]]]];
  const charts = [], cursors = [];
  let shown = 0;
  function mark() {
    charts.forEach((chart, k) => { cursors[k].style.left = `${chart.toDomXCoord(first.time(shown))}px`; });
  }
  for (const [title, solid, dashed] of SHOWN) {
    const curves = solid.concat(dashed || []);
    const rows = [];
    let any = false;
    for (let i = 0; i < first.count; ++i) {
      const row = [first.time(i)];
      for (const [name, , factor] of curves) {
        const y = first.scalar(i, name) * factor;
        any = any || !isNaN(y);
        row.push(isNaN(y) ? null : y);
      }
      rows.push(row);
    }
    if (!any) continue;
    const place = document.createElement('div');
    place.className = 'chart';
    element('charts').appendChild(place);
    const series = {};
    (dashed || []).forEach(([, label]) => { series[label] = {strokePattern: [5, 4]}; });
    charts.push(new Dygraph(place, rows, {
      title, titleHeight: 16, labels: ['t'].concat(curves.map(c => c[1])), series, legend: 'always', labelsSeparateLines: false,
      legendFormatter: data => data.series.filter(s => !/commanded/.test(s.label)).map(s =>
        `<span style="color:${s.color}">${s.labelHTML}${data.x === undefined ? '' : ' ' + s.yHTML}</span>`).join('  ') + (dashed ? '  - - commanded' : ''),
      colors: curves.map((c, k) => COLOURS[k % 3]), strokeWidth: 1.4, axisLabelFontSize: 11, gridLineColor: '#88888844',
      clickCallback: (event, t) => show(first.at(t)), drawCallback: (chart, initial) => { if (!initial) mark(); }}));
    const cursor = document.createElement('div');
    cursor.className = 'cursor';
    place.appendChild(cursor);
    cursors.push(cursor);
  }

  const fit = () => charts.forEach(chart => chart.resize());
  fit();

  // One picture.
  const nameOf = (list, i) => first.scene[list][Math.round(i)] || '';
  function show(i) {
    shown = Math.max(0, Math.min(first.count - 1, i));
    const t = first.time(shown), newtonsPerMetre = 1000 / Math.pow(10, parseFloat(element('force').value));
    bodies.forEach((b, k) => b.place(k ? b.recording.at(t) : shown, element('ghost').checked, newtonsPerMetre));
    const phase = nameOf('phases', first.scalar(shown, 'phase')), segment = first.scalar(shown, 'segment');
    const kind = nameOf('kinds', first.scalar(shown, 'kind')), cause = nameOf('checks', first.scalar(shown, 'cause'));
    const words = element('words');
    words.textContent = '';
    const head = document.createElement('b');
    head.textContent = first.scene.name;
    words.append(head, `\n${phase}${kind ? ': ' + kind : ''}${segment >= 0 ? ` (${segment + 1} of ${first.scene.segments.length})` : ''}` +
      (cause ? `\nstopped by: ${cause}` : '') + `\nforce arrow: 1 m is ${Math.round(newtonsPerMetre)} N`);
    element('time').textContent = `${t.toFixed(2)} of ${first.time(first.count - 1).toFixed(2)} s`;
    element('seek').value = shown;
    mark();
    dirty = true;
  }

  // Time goes on.
  let playing = false, clock = 0, since = 0, dirty = true;
  function play(on) {
    playing = on && first.count > 1;
    if (playing && shown === first.count - 1) show(0);
    clock = first.time(shown);
    since = performance.now();
    element('play').textContent = playing ? 'pause' : 'play';
  }
  function step(now) {
    if (playing) {
      clock += (now - since) / 1000 * parseFloat(element('speed').value);
      since = now;
      const i = first.at(clock);
      if (i !== shown) show(i);
      if (i === first.count - 1) play(false);
    }
    const width = element('stage').clientWidth, height = element('stage').clientHeight;
    const size = renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) {
      renderer.setPixelRatio(window.devicePixelRatio || 1);
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      dirty = true;
    }
    if (dirty) {
      world.background = new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue('--back').trim());
      renderer.render(world, camera);
    }
    dirty = false;
    requestAnimationFrame(step);
  }
  controls.addEventListener('change', () => { dirty = true; });
  element('seek').max = first.count - 1;
  element('seek').addEventListener('input', () => { play(false); show(parseInt(element('seek').value, 10)); });
  element('play').addEventListener('click', () => play(!playing));
  element('back').addEventListener('click', () => { play(false); show(shown - 1); });
  element('forth').addEventListener('click', () => { play(false); show(shown + 1); });
  element('ghost').addEventListener('change', () => show(shown));
  element('force').addEventListener('input', () => show(shown));
  for (const button of document.querySelectorAll('[data-view]'))
    button.addEventListener('click', () => { look(button.dataset.view); dirty = true; });
  const root = document.documentElement;
  root.dataset.theme = window.matchMedia && matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
  element('theme').addEventListener('click', () => {
    root.dataset.theme = root.dataset.theme === 'dark' ? 'light' : 'dark';
    dirty = true;
  });
  document.addEventListener('keydown', event => {
    if (event.key === ' ') { play(!playing); event.preventDefault(); }
    if (event.key === 'ArrowLeft') { play(false); show(shown - 1); }
    if (event.key === 'ArrowRight') { play(false); show(shown + 1); }
  });

  /** For tests: what the page shows now, read back from the objects that are drawn. */
  window.ves = {
    count: first.count,
    show,
    time: () => first.time(shown),
    position: name => {
      world.updateMatrixWorld(true);
      return new THREE.Vector3().setFromMatrixPosition(bodies[0].frames[name].matrixWorld).toArray();
    },
    matrix: name => {
      world.updateMatrixWorld(true);
      return bodies[0].frames[name].matrixWorld.toArray();
    }};
  show(first.at(0));
  requestAnimationFrame(step);
})();
