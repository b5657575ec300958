// The bodies of one recording, and of the base in free space beside it. All geometry comes from the
// program; the page places it where the pictures say.
const UP = new THREE.Vector3(0, 1, 0);  // of three.js's cylinders
const AHEAD = new THREE.Vector3(0, 0, 1);
const SOLID = {plate: 0x6b7885, cylinder: 0x8d99a6, axes: 0x333333};
const ROBOT = 0xe0903a, WORLD = 0x5b8c6a, GHOST = 0x7a5cc0, NOZZLE = 0x444444, PLUME = 0xff9d2e, WHEEL = 0x2f6f8f;
const ARROWS = {wrench: 0xc1121f, contact: 0x0a7d5a, push: 0x1f5fbf};
const TRAIL = 10;  // [s]

class Bodies {
  constructor(recording, world, look) {
    this.recording = recording;
    this.world = world;
    this.root = new THREE.Group();
    world.add(this.root);
    this.frames = {'': this.root};
    this.legs = [];
    for (const f of recording.scene.frames) {
      this.frames[f.name] = new THREE.Group();
      this.frames[f.parent].add(this.frames[f.name]);
    }
    recording.scene.legs.forEach((_, k) => {
      for (const name of [`leg${k + 1}`, `rod${k + 1}`]) {
        this.frames[name] = new THREE.Group();
        this.root.add(this.frames[name]);
      }
    });
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
      if (twin && shape.kind !== 'axes') twin.add(body(shape, {colour: GHOST, outline: true}));
    }
    this.arrows = {};
    for (const [name, colour] of Object.entries(ARROWS)) {
      this.arrows[name] = new Arrow(colour, Math.min(1, recording.scene.size));
      this.root.add(this.arrows[name]);
    }
    this.plumes = (recording.scene.thrusters || []).map(one => {
      const jet = new Jet(new THREE.Vector3(...one.force), 0.5 * Math.min(1, recording.scene.size));
      jet.position.set(...one.at);
      this.frames.platform.add(jet);
      return jet.plume;
    });
    this.wheels = (recording.scene.wheels || []).map(one => {
      const wheel = new Wheel(new THREE.Vector3(...one.axis), 0.5 * Math.min(1, recording.scene.size), one.most);
      wheel.position.set(...one.at);
      this.frames.platform.add(wheel);
      return wheel;
    });
    // White booms between dark joints, as the Shuttle's arm has them.
    const part = (geometry, colour) => {
      const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial(
        {color: look.colour || colour, roughness: 0.7, transparent: look.opacity < 1, opacity: look.opacity || 1}));
      mesh.castShadow = mesh.receiveShadow = true;
      this.root.add(mesh);
      return mesh;
    };
    const radius = recording.scene.arm_radius;
    this.arm = recording.scene.arm.slice(1).map(() => part(new THREE.CylinderBufferGeometry(radius, radius, 1, 24), 0xeeeeea));
    this.armJoints = recording.scene.arm.map(() => part(new THREE.SphereBufferGeometry(1.25 * radius, 24, 16), 0x3b4048));
    const trail = colour => {
      const line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({color: colour}));
      line.frustumCulled = false;
      this.root.add(line);
      return line;
    };
    this.trail = trail(look.colour || 0xc14e00);
    this.twinTrail = trail(GHOST);
    // Names stand at an edge of what they name, and not in its middle.
    const plate = recording.scene.shapes.find(s => s.kind === 'plate' && s.frame === 'platform');
    this.edges = ['platform', 'base'].map((frame, k) => {
      const edge = new THREE.Object3D(), corner = plate.corners.reduce((a, b) => 3 * b[0] + 2 * b[1] > 3 * a[0] + 2 * a[1] ? b : a);
      edge.position.set(corner[0], corner[1], plate.top - 0.06 * k * recording.scene.size);
      this.frames[frame].add(edge);
      return edge;
    });
    this.led = recording.scene.frames.some(f => f.name === 'tool') ? 'tool' : 'platform';
  }
  remove() { this.world.remove(this.root); }

  /** Pose of platform or base at picture i, its way from home times `times`; null where nobody knows. */
  pose(i, name, times) {
    const p = this.recording.frame(i, name);
    if (isNaN(p[0])) return null;
    const home = this.recording.scene.home;
    const turn = new THREE.Quaternion(p[3], p[4], p[5], p[6]);
    if (times !== 1) {
      const half = Math.acos(Math.min(1, Math.abs(turn.w))), sine = Math.sin(half);
      const axis = new THREE.Vector3(turn.x, turn.y, turn.z).multiplyScalar(sine > 1e-9 ? Math.sign(turn.w || 1) / sine : 0);
      turn.setFromAxisAngle(axis, 2 * half * times);
    }
    return {position: new THREE.Vector3(times * p[0], times * p[1], home + times * (p[2] - home)), turn};
  }

  /** `show`: ghost, trail, newtonsPerMetre, times (one exaggeration for all that moves). */
  place(i, show) {
    const r = this.recording, size = r.scene.size;
    for (const name of ['platform', 'base']) {
      const pose = this.pose(i, name, show.times);
      this.frames[name].visible = pose !== null && (name === 'platform' || show.ghost);
      if (!pose) continue;
      this.frames[name].position.copy(pose.position);
      this.frames[name].quaternion.copy(pose.turn);
    }
    const put = (object, name) => {
      const p = r.frame(i, name);
      object.visible = !isNaN(p[0]);
      if (!object.visible) return;
      object.position.set(p[0], p[1], p[2]);
      object.quaternion.set(p[3], p[4], p[5], p[6]);
    };
    for (const f of r.scene.frames) if (f.name !== 'platform' && f.name !== 'base') put(this.frames[f.name], f.name);
    for (const [name, twin] of this.twins) put(twin, name);
    this.placeLegs(i);
    this.root.updateMatrixWorld(true);
    this.placeArrows(i, show.newtonsPerMetre, size);
    this.plumes.forEach((plume, k) => { plume.visible = (r.scalar(i, 'thrusters_on') >> k & 1) === 1; });
    this.wheels.forEach((wheel, k) => wheel.turn(r.scalar(i, `wheel${k}_momentum`), r.time(i)));
    const points = r.scene.arm.map((p, k) =>
      new THREE.Vector3(...p).addScaledVector(new THREE.Vector3(...r.bent(i, k)), show.times));
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
    this.trail.visible = show.trail;
    this.twinTrail.visible = show.trail && show.ghost;
    if (show.trail) {
      this.draw(this.trail, i, 'platform', show.times);
      if (show.ghost) this.draw(this.twinTrail, i, 'base', show.times);
    }
  }
  /** From joint to joint; green in the middle of the stroke, grey, then red at a limit. */
  placeLegs(i) {
    const joints = this.recording.scene.legs;
    this.frames.platform.updateMatrixWorld(true);
    joints.forEach(([below, above], k) => {
      const from = new THREE.Vector3(...below);
      const to = new THREE.Vector3(...above).applyMatrix4(this.frames.platform.matrix);
      const turn = new THREE.Quaternion().setFromUnitVectors(AHEAD, to.clone().sub(from).normalize());
      this.frames[`leg${k + 1}`].position.copy(from);
      this.frames[`rod${k + 1}`].position.copy(to);
      for (const name of ['leg', 'rod']) this.frames[`${name}${k + 1}`].quaternion.copy(turn);
    });
    for (const [leg, mesh] of this.legs) {
      const margin = Math.max(0, Math.min(1, this.recording.scalar(i, `leg${leg + 1}_margin`)));
      mesh.material.color.setHSL(0.58 * Math.min(1, margin * 2), margin < 0.5 ? 0.6 : 0.08, 0.55);
    }
  }
  placeArrows(i, newtonsPerMetre, size) {
    const r = this.recording;
    const arrow = (name, force, at) => {
      const length = force.length() / newtonsPerMetre, one = this.arrows[name];
      one.visible = at !== null && length > 0.02 * size && isFinite(length);
      if (!one.visible) return;
      one.position.copy(at);
      one.point(force, Math.min(length, 3 * size));
    };
    arrow('wrench', r.vector(i, ['fx_dynamic', 'fy_dynamic', 'fz_dynamic']), this.frames.platform.position);
    // On the line along which it acts, at the place nearest to the tool.
    const f = r.vector(i, ['fx_contact', 'fy_contact', 'fz_contact']), n = r.vector(i, ['mx_contact', 'my_contact', 'mz_contact']);
    let at = null;
    if (f.lengthSq() > 0 && this.frames.tool)
      at = f.clone().cross(n).divideScalar(f.lengthSq()).add(this.frames.tool.getWorldPosition(new THREE.Vector3()));
    arrow('contact', f, at);
    const pushed = this.frames[['platform', `link${r.scalar(i, 'push_link') + 1}`, 'target'][r.scalar(i, 'push_on')]];
    arrow('push', r.vector(i, ['push_fx', 'push_fy', 'push_fz']),
          pushed ? pushed.localToWorld(r.vector(i, ['push_x', 'push_y', 'push_z'])) : null);
  }
  /** Where the tool was in the last seconds, on the platform or on the base in free space. */
  draw(line, i, on, times) {
    const r = this.recording, places = [], led = new THREE.Vector3();
    const first = r.at(r.time(i) - TRAIL), every = Math.max(1, Math.floor((i - first) / 400));
    for (let k = first; k <= i; k += every) {
      const pose = this.pose(k, on, times);
      if (!pose || isNaN(r.frame(k, this.led)[0])) continue;
      if (this.led === 'tool') led.set(...r.frame(k, 'tool').subarray(0, 3)); else led.set(0, 0, 0);
      led.applyQuaternion(pose.turn).add(pose.position);
      places.push(led.x, led.y, led.z);
    }
    line.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(places), 3));
    line.geometry.setDrawRange(0, places.length / 3);
  }
}

/** From its origin, drawn over everything: a force that begins inside a body is seen. */
class Arrow extends THREE.Group {
  constructor(colour, size) {
    super();
    this.head = 0.1 * size;
    const material = new THREE.MeshBasicMaterial({color: colour, depthTest: false, transparent: true});
    const part = geometry => {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.renderOrder = 1;
      this.add(mesh);
      return mesh;
    };
    this.shaft = part(new THREE.CylinderBufferGeometry(0.008 * size, 0.008 * size, 1, 12).translate(0, 0.5, 0));
    this.cone = part(new THREE.CylinderBufferGeometry(0, 0.03 * size, this.head, 16));
    this.visible = false;
  }
  /** `length` [m] along `way`. */
  point(way, length) {
    this.quaternion.setFromUnitVectors(UP, way.clone().normalize());
    this.shaft.scale.y = Math.max(1e-6, length - 0.5 * this.head);
    this.cone.position.y = length - 0.5 * this.head;
  }
}

/** A thruster that pushes with `force`: its nozzle, and what comes out of it the other way. */
class Jet extends THREE.Group {
  constructor(force, size) {
    super();
    const part = (geometry, material) => {
      const mesh = new THREE.Mesh(geometry, material);
      this.add(mesh);
      return mesh;
    };
    part(new THREE.CylinderBufferGeometry(0.02 * size, 0.05 * size, 0.1 * size, 16), new THREE.MeshStandardMaterial({color: NOZZLE}));
    this.plume = part(new THREE.ConeBufferGeometry(0.06 * size, 0.4 * size, 16).rotateX(Math.PI).translate(0, -0.25 * size, 0),
                      new THREE.MeshBasicMaterial({color: PLUME, transparent: true, opacity: 0.7}));
    this.quaternion.setFromUnitVectors(UP, force.normalize());
  }
}

/** A reaction wheel about `axis`. It turns as fast as it has momentum, once a second with the `most` of its schedule. */
class Wheel extends THREE.Group {
  constructor(axis, size, most) {
    super();
    this.most = most;
    this.time = NaN;
    this.rotor = new THREE.Group();
    const part = geometry => this.rotor.add(new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({color: WHEEL, roughness: 0.4, metalness: 0.5})));
    const radius = 0.22 * size;
    part(new THREE.TorusBufferGeometry(radius, 0.12 * radius, 12, 48).rotateX(Math.PI / 2));
    for (const k of [0, 1, 2]) part(new THREE.BoxBufferGeometry(2 * radius, 0.06 * radius, 0.12 * radius).rotateY(k * Math.PI / 3));
    part(new THREE.CylinderBufferGeometry(0.1 * radius, 0.1 * radius, 0.5 * radius, 16));
    this.rotor.position.y = 0.3 * size;  // several about one place do not meet
    this.add(this.rotor);
    this.quaternion.setFromUnitVectors(UP, axis);
  }
  turn(momentum, time) {
    const passed = time - this.time;
    if (Math.abs(passed) < 1 && this.most > 0) this.rotor.rotation.y += 2 * Math.PI * momentum / this.most * passed;
    this.time = time;
  }
}

/** `look`: colour and opacity in place of its own; outline: edges, and hardly a surface. */
function body(shape, look) {
  const ghost = look.outline === true;
  const material = new THREE.MeshStandardMaterial({
    color: look.colour || shape.colour || (shape.world && WORLD) || SOLID[shape.kind] || ROBOT,
    transparent: ghost || look.opacity < 1, opacity: ghost ? 0.13 : look.opacity || 1,
    roughness: 0.55, metalness: shape.kind === 'cylinder' ? 0.35 : 0.05,
    depthWrite: !ghost && !(look.opacity < 1),
    // Where the ghost is in the same place, it is behind.
    polygonOffset: ghost || look.opacity < 1, polygonOffsetFactor: 2, polygonOffsetUnits: 2});
  const group = new THREE.Group();
  const add = (geometry, place) => {
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = !ghost;
    mesh.receiveShadow = !ghost;
    if (place) place(mesh);
    group.add(mesh);
    if (ghost && shape.kind !== 'mesh') {
      const edges = new THREE.LineSegments(new THREE.EdgesGeometry(geometry, 40), new THREE.LineBasicMaterial({color: look.colour, transparent: true, opacity: 0.7}));
      edges.position.copy(mesh.position);
      edges.quaternion.copy(mesh.quaternion);
      group.add(edges);
    }
  };
  if (shape.kind === 'plate') {
    const outline = new THREE.Shape(shape.corners.map(c => new THREE.Vector2(c[0], c[1])));
    add(new THREE.ExtrudeBufferGeometry(outline, {depth: shape.thickness, bevelEnabled: false}),
        mesh => { mesh.position.z = shape.top - shape.thickness; });
  } else if (shape.kind === 'cylinder') {
    const from = shape.from || [0, 0, 0];
    add(new THREE.CylinderBufferGeometry(shape.radius, shape.radius, Math.abs(shape.length), 24), mesh => {
      mesh.rotation.x = Math.PI / 2;
      mesh.position.set(from[0], from[1], from[2] + shape.length / 2);
    });
  } else if (shape.kind === 'capsule') {
    const a = new THREE.Vector3(...shape.from), b = new THREE.Vector3(...shape.to);
    const way = b.clone().sub(a);
    add(new THREE.CylinderBufferGeometry(shape.radius, shape.radius, way.length(), 24), mesh => {
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
