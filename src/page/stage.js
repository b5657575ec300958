// The room: renderer, camera, lights, floor, labels. z is up.
const element = id => document.getElementById(id);

class Stage {
  constructor() {
    THREE.Object3D.DefaultUp.set(0, 0, 1);
    this.canvas = element('canvas');
    this.renderer = new THREE.WebGLRenderer({canvas: this.canvas, antialias: true, preserveDrawingBuffer: true});
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.world = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.05, 100);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => { this.dirty = true; });
    this.world.add(new THREE.HemisphereLight(0xffffff, 0x8a8a92, 0.62));
    this.sun = new THREE.DirectionalLight(0xffffff, 0.62);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.radius = 3;
    this.world.add(this.sun, this.sun.target);
    const fill = new THREE.DirectionalLight(0xdfe8ff, 0.22);
    fill.position.set(-4, 2, 3);
    this.world.add(fill);
    // The laboratory's floor; an arm stands in space, and not in a floor.
    this.floor = new THREE.Group();
    this.grid = new THREE.GridHelper(6, 24, 0x888888, 0xb4b4b4);
    this.grid.rotation.x = Math.PI / 2;
    this.grid.material.transparent = true;
    this.grid.material.opacity = 0.35;
    const ground = new THREE.Mesh(new THREE.PlaneBufferGeometry(6, 6), new THREE.ShadowMaterial({opacity: 0.28}));
    ground.receiveShadow = true;
    ground.position.z = -0.001;
    this.floor.add(this.grid, ground);
    this.world.add(this.floor);
    this.labels = [];
    this.dirty = true;
  }
  /** A scene of its own size. */
  begin(scene) {
    this.scene = scene;
    const size = scene.size, reach = Math.min(scene.reach, 3 * size);
    this.middle = new THREE.Vector3(0, 0, 0.8 * scene.home + 0.25 * reach);
    this.far = 2.6 * size + scene.home + 0.7 * reach;
    this.floor.visible = scene.arm.length < 2;
    this.floor.scale.setScalar(size);
    this.sun.position.set(1.2 * this.far, -1.4 * this.far, 2.2 * this.far);
    this.sun.target.position.copy(this.middle);
    const box = this.sun.shadow.camera, half = 0.75 * this.far;
    [box.left, box.right, box.top, box.bottom, box.near, box.far] = [-half, half, half, -half, 0.5 * this.far, 5 * this.far];
    box.updateProjectionMatrix();
    this.look('iso');
  }
  look(view) {
    const target = this.middle.clone();
    let far = this.far;
    if (view === 'arm') {  // all of it
      const box = new THREE.Box3().setFromPoints(this.scene.arm.map(p => new THREE.Vector3(...p)));
      box.getCenter(target);
      far = 1.3 * box.getSize(new THREE.Vector3()).length();
    }
    this.camera.near = 0.02 * far;
    this.camera.far = 20 * far;
    this.camera.updateProjectionMatrix();
    const from = {iso: [0.62, -0.95, 0.5], front: [0, -1.15, 0.02], side: [1.15, 0, 0.02], top: [0, -0.001, 1.2],
                  arm: [0.62, -0.95, 0.5]}[view];
    this.camera.position.set(target.x + far * from[0], target.y + far * from[1], target.z + far * from[2]);
    this.controls.target.copy(target);
    this.controls.update();
    this.dirty = true;
  }
  /** Names beside what they name: [text, object, class]. */
  label(things) {
    for (const l of this.labels) l.place.remove();
    this.labels = things.map(([text, object, kind]) => {
      const place = document.createElement('span');
      place.className = `label ${kind || ''}`;
      place.textContent = text;
      element('stage').appendChild(place);
      return {place, object};
    });
  }
  placeLabels(width, height) {
    const shown = element('labels').checked;
    for (const {place, object} of this.labels) {
      const at = object.getWorldPosition(new THREE.Vector3()).project(this.camera);
      let there = true;
      for (let o = object; o; o = o.parent) there = there && o.visible;
      place.hidden = !shown || !there || at.z > 1;
      place.style.transform = `translate(${Math.round((at.x + 1) / 2 * width)}px, ${Math.round((1 - at.y) / 2 * height)}px)`;
    }
  }
  /** The ray under the mouse. */
  ray(event) {
    const box = this.canvas.getBoundingClientRect(), caster = new THREE.Raycaster();
    caster.setFromCamera({x: 2 * (event.clientX - box.left) / box.width - 1, y: 1 - 2 * (event.clientY - box.top) / box.height}, this.camera);
    return caster;
  }
  draw() {
    const width = element('stage').clientWidth, height = element('stage').clientHeight;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) {
      this.renderer.setPixelRatio(window.devicePixelRatio || 1);
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.dirty = true;
    }
    if (!this.dirty) return;
    this.dirty = false;
    this.world.background = new THREE.Color(colourOf('--back'));
    this.renderer.render(this.world, this.camera);
    this.placeLabels(width, height);
  }
}

const colourOf = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
