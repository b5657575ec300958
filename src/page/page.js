// SPDX-License-Identifier: BSD-3-Clause
'use strict';
// The page places objects where the pictures say; all geometry comes from the program.
(function () {
  const KEPT = 60;          // [s] of a live run
  const REDRAWN = 250;      // [ms] between a live run's charts
  const UP = new THREE.Vector3(0, 1, 0);  // of three.js's cylinders
  const COLOURS = ['#0067a8', '#c14e00', '#00805e'];
  const NUMBERS = 7;  // of a frame: position, quaternion

  const floats = base64 => new Float32Array(Uint8Array.from(atob(base64), c => c.charCodeAt(0)).buffer);

  /** Pictures of one run, in the order of time. */
  class Recording {
    constructor(scene, width, pictures) {
      this.scene = scene;
      this.width = width;
      this.pictures = pictures;
      this.frameAt = new Map(scene.frames.map((f, k) => [f.name, NUMBERS * k]));
      this.armAt = NUMBERS * scene.frames.length;
      this.scalarAt = new Map(scene.scalars.map((name, k) => [name, this.armAt + 3 * scene.arm.length + k]));
    }
    static of(data) {
      const numbers = floats(data.pictures), pictures = [];
      for (let i = 0; i < numbers.length; i += data.width) pictures.push(numbers.subarray(i, i + data.width));
      return new Recording(data.scene, data.width, pictures);
    }
    get count() { return this.pictures.length; }
    frame(i, name) {
      const k = this.frameAt.get(name);
      return this.pictures[i].subarray(k, k + NUMBERS);
    }
    /** By which point k of the arm is bent. */
    bent(i, k) { return this.pictures[i].subarray(this.armAt + 3 * k, this.armAt + 3 * k + 3); }
    knows(name) { return this.scalarAt.has(name); }
    scalar(i, name) { return this.pictures[i][this.scalarAt.get(name)]; }
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
      this.world = world;
      this.frames = {'': world};
      this.legs = [];
      this.shapes = [];  // that stand still
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
        if (shape.frame === '') this.shapes.push(mesh);
        if ('leg' in shape) this.legs.push([shape.leg, mesh]);
        const twin = twinOf(shape.frame);
        if (twin) twin.add(body(shape, {colour: 0x7a5cc0, opacity: 0.22}));
      }
      this.force = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.1, 0xc1121f, 0.08, 0.05);
      world.add(this.force);
      // White booms between dark joints, as the Shuttle's arm has them.
      const part = (geometry, colour) => {
        const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial(
          {color: look.colour || colour, roughness: 0.7, transparent: look.opacity < 1, opacity: look.opacity || 1}));
        world.add(mesh);
        return mesh;
      };
      const radius = recording.scene.arm_radius;
      this.arm = recording.scene.arm.slice(1).map(() => part(new THREE.CylinderBufferGeometry(radius, radius, 1, 24), 0xeeeeea));
      this.armJoints = recording.scene.arm.map(() => part(new THREE.SphereBufferGeometry(1.25 * radius, 24, 16), 0x3b4048));
    }
    remove() {
      for (const f of this.recording.scene.frames) if (f.parent === '') this.world.remove(this.frames[f.name]);
      for (const shape of this.shapes) this.world.remove(shape);
      for (const mesh of this.arm.concat(this.armJoints)) this.world.remove(mesh);
      this.world.remove(this.force);
    }
    /** `show`: ghost, newtonsPerMetre, bending. */
    place(i, show) {
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
      this.frames.base.visible = this.frames.base.visible && show.ghost;
      for (const [leg, mesh] of this.legs) {
        const margin = Math.max(0, Math.min(1, r.scalar(i, `leg${leg + 1}_margin`)));
        mesh.material.color.setHSL(0.33 * Math.min(1, margin * 2), margin < 0.5 ? 0.6 : 0.12, 0.5);
      }
      const f = new THREE.Vector3(r.scalar(i, 'fx_dynamic'), r.scalar(i, 'fy_dynamic'), r.scalar(i, 'fz_dynamic'));
      const size = r.scene.size, length = f.length() / show.newtonsPerMetre;
      this.force.visible = length > 0.02 * size && isFinite(length);
      if (this.force.visible) {
        this.force.position.copy(this.frames.platform.position);
        this.force.setDirection(f.normalize());
        this.force.setLength(Math.min(length, 3 * size), 0.08 * size, 0.05 * size);
      }
      const points = r.scene.arm.map((p, k) =>
        new THREE.Vector3(...p).addScaledVector(new THREE.Vector3(...r.bent(i, k)), show.bending));
      this.armJoints.forEach((mesh, k) => {
        mesh.position.copy(points[k]);
        mesh.visible = k > 0 && k < points.length - 1;
      });
      this.arm.forEach((mesh, k) => {
        const way = points[k + 1].clone().sub(points[k]), length = way.length();
        mesh.visible = length > 1e-6;
        if (!mesh.visible) return;
        mesh.position.copy(points[k]).addScaledVector(way, 0.5);
        mesh.quaternion.setFromUnitVectors(UP, way.normalize());
        mesh.scale.set(1, length, 1);
      });
    }
  }

  function body(shape, look) {
    const material = new THREE.MeshStandardMaterial({
      color: look.colour || shape.colour || (shape.world && 0x5b8c6a) || {plate: 0x6b7885, cylinder: 0x8d99a6, capsule: 0xe0903a, rod: 0xe0903a, sphere: 0xe0903a, box: 0xe0903a, mesh: 0xe0903a, axes: 0x333333}[shape.kind],
      transparent: look.opacity < 1, opacity: look.opacity || 1, roughness: 0.6, metalness: 0.1,
      depthWrite: !(look.opacity < 1),
      // Where the ghost is in the same place, it is behind.
      polygonOffset: look.opacity < 1, polygonOffsetFactor: 2, polygonOffsetUnits: 2});
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
        mesh.quaternion.setFromUnitVectors(UP, way.clone().normalize());
      });
      for (const end of [a, b])
        add(new THREE.SphereBufferGeometry(shape.radius * 1.15, 18, 14), mesh => mesh.position.copy(end));
    } else if (shape.kind === 'rod') {
      add(new THREE.CylinderBufferGeometry(shape.radius, shape.radius, shape.length, 24), mesh => {
        mesh.rotation.x = Math.PI / 2;
      });
    } else if (shape.kind === 'sphere') {
      add(new THREE.SphereBufferGeometry(shape.radius, 24, 18));
    } else if (shape.kind === 'box') {
      add(new THREE.BoxBufferGeometry(...shape.size));
    } else if (shape.kind === 'mesh') {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.BufferAttribute(floats(shape.triangles), 3));
      geometry.computeVertexNormals();
      material.side = THREE.DoubleSide;
      add(geometry);
    } else if (shape.kind === 'axes') {
      group.add(new THREE.AxesHelper(shape.size));
    }
    if (shape.position) group.position.set(...shape.position);
    if (shape.quaternion) group.quaternion.set(...shape.quaternion);
    group.material = material;
    return group;
  }

  const element = id => document.getElementById(id);
  let first = null, bodies = [], live = null;

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
  world.add(grid);  // the laboratory's floor
  function look(view) {
    const size = first.scene.size, reach = Math.min(first.scene.reach, 3 * size), target = new THREE.Vector3(0, 0, 0.8 * first.scene.home + 0.25 * reach);
    let far = 2.6 * size + first.scene.home + 0.7 * reach;
    if (view === 'arm') {  // all of it
      const box = new THREE.Box3().setFromPoints(first.scene.arm.map(p => new THREE.Vector3(...p)));
      box.getCenter(target);
      far = 1.3 * box.getSize(new THREE.Vector3()).length();
    }
    camera.near = 0.02 * far;
    camera.far = 20 * far;
    camera.updateProjectionMatrix();
    grid.scale.setScalar(size);
    const from = {iso: [0.62, -0.95, 0.5], front: [0, -1.15, 0.02], side: [1.15, 0, 0.02], top: [0, -0.001, 1.2],
                  arm: [0.62, -0.95, 0.5]}[view];
    camera.position.set(target.x + far * from[0], target.y + far * from[1], target.z + far * from[2]);
    controls.target.copy(target);
    controls.update();
  }

  // Charts: one column of time, one a curve.
  const pose = (what, names, factor) => names.map(c => [`${c}_${what}`, what === 'actual' ? c : `${c} ${what}`, factor]);
  const SHOWN = [
    ['position [mm]', pose('actual', ['x', 'y', 'z'], 1e3), pose('commanded', ['x', 'y', 'z'], 1e3), pose('measured', ['x', 'y', 'z'], 1e3)],
    ['attitude [deg]', pose('actual', ['alpha', 'beta', 'gamma'], 180 / Math.PI), pose('commanded', ['alpha', 'beta', 'gamma'], 180 / Math.PI),
      pose('measured', ['alpha', 'beta', 'gamma'], 180 / Math.PI)],
    ['force, gravity taken out [N]', ['fx', 'fy', 'fz'].map(c => [`${c}_dynamic`, c, 1])],
    ['moment [N m]', ['mx', 'my', 'mz'].map(c => [`${c}_dynamic`, c, 1])],
    ['legs, commanded minus measured [mm]', [1, 2, 3, 4, 5, 6].map(i => [`leg${i}_error_m`, `leg ${i}`, 1e3])],
    ['woke late [ms]', [['late_s', 'late', 1e3]]],
    ['real-time factor', [['real_time_factor', 'factor', 1]]]];
  let charts = [], marks = [];
  let shown = 0;
  const nameOf = (list, i) => first.scene[list][Math.round(i)] || '';
  function mark() {
    if (first.count) charts.forEach(c => { c.cursor.style.left = `${c.chart.toDomXCoord(first.time(shown))}px`; });
  }
  /** What begins at picture i, if anything does. */
  function markOf(i) {
    const what = k => `${first.scalar(k, 'phase')} ${first.scalar(k, 'segment')}`;
    if (i > 0 && what(i) === what(i - 1)) return;
    const kind = nameOf('kinds', first.scalar(i, 'kind')), phase = nameOf('phases', first.scalar(i, 'phase'));
    marks.push({t: first.time(i), text: phase === 'running' ? kind : phase});
  }
  /** Lines where segments begin; their names in the first chart. */
  function drawMarks(context, area, chart, named) {
    context.save();
    context.strokeStyle = '#88888888';
    context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--soft');
    context.font = '10px system-ui, sans-serif';
    let free = -Infinity;
    for (const m of marks) {
      const x = chart.toDomXCoord(m.t);
      if (x < area.x || x > area.x + area.w) continue;
      context.beginPath();
      context.moveTo(x, area.y);
      context.lineTo(x, area.y + area.h);
      context.stroke();
      if (!named || x < free) continue;
      context.fillText(m.text, x + 3, area.y + area.h - 4);
      free = x + 3 + context.measureText(m.text).width;
    }
    context.restore();
  }
  function chartOf(title, solid, dashed = [], dotted = []) {
    const curves = solid.concat(dashed, dotted);
    if (!curves.every(c => first.knows(c[0]))) return;
    const row = i => [first.time(i)].concat(curves.map(([name, , factor]) => {
      const y = first.scalar(i, name) * factor;
      return isNaN(y) ? null : y;
    }));
    const rows = first.pictures.map((_, i) => row(i));
    if (!live && rows.every(r => r.slice(1).every(y => y === null))) return;
    const place = document.createElement('div');
    place.className = 'chart';
    element('charts').appendChild(place);
    const series = {}, named = charts.length === 0;
    dashed.forEach(([, label]) => { series[label] = {strokePattern: [5, 4]}; });
    dotted.forEach(([, label]) => { series[label] = {strokePattern: [1, 3], strokeWidth: 1}; });
    const chart = new Dygraph(place, rows.length ? rows : [[0].concat(curves.map(() => null))], {
      title, titleHeight: 16, labels: ['t'].concat(curves.map(c => c[1])), series, legend: 'always', labelsSeparateLines: false,
      legendFormatter: data => data.series.filter(s => !/ (commanded|measured)/.test(s.label)).map(s =>
        `<span style="color:${s.color}">${s.labelHTML}${data.x === undefined ? '' : ' ' + s.yHTML}</span>`).join('  ') + (dashed.length ? '  - - commanded  . . measured' : ''),
      colors: curves.map((c, k) => COLOURS[k % 3]), strokeWidth: 1.4, axisLabelFontSize: 11, axes: {y: {pixelsPerLabel: 24}}, gridLineColor: '#88888844',
      underlayCallback: (context, area, g) => drawMarks(context, area, g, named),
      clickCallback: (event, t) => { play(false); show(first.at(t)); }, drawCallback: (c, initial) => { if (!initial) mark(); }});
    const cursor = document.createElement('div');
    cursor.className = 'cursor';
    place.appendChild(cursor);
    charts.push({chart, cursor, rows, row});
  }

  const fit = () => charts.forEach(c => c.chart.resize());

  /** A page of these from here on; the first has the charts. */
  function begin(recordings) {
    bodies.forEach(b => b.remove());
    charts.forEach(c => c.chart.destroy());
    element('charts').textContent = '';
    [charts, marks, shown, first] = [[], [], 0, recordings[0]];
    bodies = recordings.map((r, k) => new Bodies(r, world, k ? {colour: 0x3a7ca5, opacity: 0.4} : {}));
    first.pictures.forEach((_, i) => markOf(i));
    for (const chart of SHOWN) chartOf(...chart);
    fit();
    for (const place of document.querySelectorAll('.arm')) place.hidden = first.scene.arm.length < 2;
    grid.visible = first.scene.arm.length < 2;  // the arm stands in space, and not in a floor
    document.title = first.scene.name;
    element('seek').max = Math.max(0, first.count - 1);
    look('iso');
    if (first.count) show(first.at(0));
  }

  // One picture.
  function show(i) {
    if (!first || !first.count) return;
    shown = Math.max(0, Math.min(first.count - 1, i));
    const t = first.time(shown), newtonsPerMetre = 1000 * Math.pow(Math.min(first.scene.size, 1), 2) / Math.pow(10, parseFloat(element('force').value));
    const bending = parseFloat(element('bending').value);
    bodies.forEach((b, k) => b.place(k ? b.recording.at(t) : shown, {ghost: element('ghost').checked, newtonsPerMetre, bending}));
    const phase = nameOf('phases', first.scalar(shown, 'phase')), segment = first.scalar(shown, 'segment');
    const kind = nameOf('kinds', first.scalar(shown, 'kind')), cause = nameOf('checks', first.scalar(shown, 'cause'));
    const asked = first.knows('stop_requested') ? first.scalar(shown, 'stop_requested') : 0;
    const lines = [`${phase}${phase === 'running' && kind ? ': ' + kind : ''}${segment >= 0 && segment < first.scene.segments.length ? ` (${segment + 1} of ${first.scene.segments.length})` : ''}`];
    if (cause) lines.push(`stopped by: ${cause}`);
    if (asked) lines.push(asked < 2 ? 'stop requested' : 'stop requested from a browser, and taken');
    lines.push(`force arrow: 1 m is ${newtonsPerMetre < 10 ? newtonsPerMetre.toFixed(1) : Math.round(newtonsPerMetre)} N`);
    if (first.scene.arm.length && bending > 1) lines.push(`arm's bending times ${bending}`);
    if (live && live.closed) lines.push('no connection: the run or its viewer has ended');
    const words = element('words'), head = document.createElement('b');
    words.textContent = '';
    head.textContent = first.scene.name;
    words.append(head, '\n' + lines.join('\n'));
    element('time').textContent = live ? `${t.toFixed(2)} s` : `${t.toFixed(2)} of ${first.time(first.count - 1).toFixed(2)} s`;
    element('seek').value = shown;
    mark();
    dirty = true;
  }

  // Time goes on.
  let playing = false, clock = 0, since = 0, dirty = true;
  function play(on) {
    if (!first) return;
    playing = on && (live !== null || first.count > 1);
    if (playing && !live && shown === first.count - 1) show(0);
    clock = first.count ? first.time(shown) : 0;
    since = performance.now();
    element('play').textContent = playing ? 'pause' : live ? 'live' : 'play';
  }
  function step(now) {
    if (live) live.draw(now);
    else if (playing) {
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
  element('seek').addEventListener('input', () => { play(false); show(parseInt(element('seek').value, 10)); });
  element('play').addEventListener('click', () => play(!playing));
  element('back').addEventListener('click', () => { play(false); show(shown - 1); });
  element('forth').addEventListener('click', () => { play(false); show(shown + 1); });
  element('ghost').addEventListener('change', () => show(shown));
  element('force').addEventListener('input', () => show(shown));
  element('bending').addEventListener('input', () => show(shown));
  for (const button of document.querySelectorAll('[data-view]'))
    button.addEventListener('click', () => { if (first) look(button.dataset.view); dirty = true; });
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

  /** The run on the bus: the newest picture, and every sample of the last minute. */
  class Live {
    constructor() {
      this.edition = 0;
      this.redrawn = 0;
      this.head = [0, 0, 0];  // of the last picture: its number, its time [ns], real-time factor
      element('stop').hidden = false;
      element('speed').hidden = true;
      element('stop').addEventListener('click', () => this.send(`stop ${this.edition}`));
      element('words').textContent = 'waiting for a run on the bus';
      this.connect();
    }
    connect() {
      this.socket = new WebSocket(`ws://${location.host}/${location.search}`, 'ves');
      this.socket.binaryType = 'arraybuffer';
      this.socket.onopen = () => { this.closed = false; };
      this.socket.onclose = () => {
        this.closed = true;
        this.waiting = null;
        show(shown);
        setTimeout(() => this.connect(), 2000);
      };
      this.socket.onmessage = message => {
        if (typeof message.data === 'string') this.begin(JSON.parse(message.data));
        else this.waiting = message.data;
      };
    }
    get home() { return first.scene.home; }
    send(text) { if (this.socket.readyState === WebSocket.OPEN) this.socket.send(text); }
    begin(data) {
      this.edition = data.edition;
      this.waiting = null;
      begin([new Recording(data.scene, data.width, [])]);
      play(true);
    }
    /** Shows what has come, and asks for the next by saying so. */
    draw(now) {
      if (!this.waiting) return;
      this.head = Array.from(new Float64Array(this.waiting, 0, 3));
      const numbers = new Float32Array(this.waiting, 24);
      this.waiting = null;
      this.send('drawn');
      if (!numbers.length || numbers.length % first.width) return;
      // All that have come since the one before: the scene shows the last, the curves have each.
      for (let from = 0; from < numbers.length; from += first.width) {
        first.pictures.push(numbers.slice(from, from + first.width));
        markOf(first.count - 1);
        for (const c of charts) c.rows.push(c.row(first.count - 1));
      }
      while (first.time(0) < first.time(first.count - 1) - KEPT) {
        first.pictures.shift();
        for (const c of charts) c.rows.shift();
        shown = Math.max(0, shown - 1);
      }
      element('seek').max = first.count - 1;
      if (playing) show(first.count - 1);
      if (now - this.redrawn < REDRAWN) return;
      this.redrawn = now;
      for (const c of charts) c.chart.updateOptions({file: c.rows});
    }
  }

  /** For tests: what the page shows now, read back from the objects that are drawn. */
  window.ves = {
    get count() { return first ? first.count : 0; },
    get live() { return live; },
    get words() { return element('words').textContent; },
    show,
    time: () => first.time(shown),
    charted: () => charts.length ? charts[0].rows.map(row => row[0]) : [],
    position: name => {
      world.updateMatrixWorld(true);
      return new THREE.Vector3().setFromMatrixPosition(bodies[0].frames[name].matrixWorld).toArray();
    },
    matrix: name => {
      world.updateMatrixWorld(true);
      return bodies[0].frames[name].matrixWorld.toArray();
    }};
  if (window.VES_RECORDINGS.length) begin(window.VES_RECORDINGS.map(Recording.of));
  else live = new Live();
  requestAnimationFrame(step);
})();
