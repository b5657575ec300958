// The run on the bus: the newest picture, and every sample of the last minute. Of a simulated
// machine also what a hand may do: push it, change the vehicle, hold time.
const KEPT = 60;          // [s] of a live run
const REDRAWN = 250;      // [ms] between a live run's charts
const NEWTONS = 0.25;     // [N] a pixel of the mouse's way
const MOST = 199.9;       // [N] of a push, and rounding
const TRIES = 5;          // to connect again
const SETTLED = 400;      // [ms] without a touch of a slider, before it is asked for

class Live {
  constructor() {
    this.edition = this.tries = 0;
    this.redrawn = 0;
    this.head = [0, 0, 0];  // of the last picture: its number, its time [ns], real-time factor
    element('speed').hidden = true;
    element('stop').addEventListener('click', () => this.send(`stop ${this.edition}`));
    for (const button of document.querySelectorAll('[data-pace]'))
      button.addEventListener('click', () => {
        this.send(`pace ${this.edition} ${button.dataset.pace}`);
        this.stands = button.dataset.pace === '0';
        show(shown);
      });
    for (const id of ['mass', 'damping', 'stiffness'])
      element(id).addEventListener('input', () => {
        element(id).nextElementSibling.textContent = `× ${factor(id)}`;
        clearTimeout(this.settling);
        this.settling = setTimeout(() => this.send(`vehicle ${this.edition} ${factor('mass')} ${factor('damping')} ${factor('stiffness')} 2`), SETTLED);
      });
    element('words').textContent = 'waiting for a run on the bus';
    this.touch();
    this.connect();
  }
  connect() {
    this.socket = new WebSocket(`ws://${location.host}/${location.search}`, 'ves');
    this.socket.binaryType = 'arraybuffer';
    this.socket.onopen = () => { this.closed = false; this.tries = 0; };
    this.socket.onclose = () => {
      this.closed = true;
      this.waiting = null;
      element('touch').hidden = element('stop').hidden = true;
      show(shown);
      if (++this.tries < TRIES) setTimeout(() => this.connect(), 2000);
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
    this.stands = false;
    for (const id of ['mass', 'damping', 'stiffness']) {
      element(id).value = 0;
      element(id).nextElementSibling.textContent = '× 1';
    }
    begin([new Recording(data.scene, data.width, [], new Curves(data.columns, true))]);
    element('stop').hidden = false;
    element('touch').hidden = !data.scene.simulated;
    element('paces').hidden = true;
    for (const id of ['damping', 'stiffness']) element(id).parentElement.hidden = data.scene.floats;
    for (const [on, known] of [['tool', bodies[0].frames.tool], ['target', data.scene.target]])
      document.querySelector(`#pushed [value=${on}]`).hidden = !known;
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
      const one = numbers.slice(from, from + first.width);
      first.pictures.push(one);
      first.curves.push(first.time(first.count - 1), one.subarray(first.curvesAt));
      markAt(first.count - 1);
      charts.extend(first.count - 1);
    }
    let old = 0;
    while (first.time(old) < first.time(first.count - 1) - KEPT) ++old;
    if (old) {
      first.pictures.splice(0, old);
      first.curves.drop(old);
      charts.drop(old);
      shown = Math.max(0, shown - old);
    }
    element('seek').max = first.count - 1;
    element('paces').hidden = isNaN(first.scalar(first.count - 1, 'pace'));
    if (playing) show(first.count - 1);
    if (now - this.redrawn < REDRAWN) return;
    this.redrawn = now;
    charts.redraw();
  }
  /** What there is to say besides. */
  lines(i) {
    const out = [], refusal = first.scalar(i, 'vehicle_refusal');
    const stop = first.scalar(i, 'stop_asked'), vehicle = first.scalar(i, 'vehicle_asked');
    if (stop) out.push(['', 'stop requested', first.scalar(i, 'stop_refusal') ? 'stop requested, and overtaken' : 'stop requested from a browser, and taken', 'stop requested, and no answer'][stop]);
    if (vehicle === 1) out.push('vehicle: the stability check is asked');
    if (vehicle === 3) out.push('vehicle: no answer');
    if (vehicle === 2) out.push(refusal ? `vehicle: refused, ${nameOf('refusals', refusal)}` : 'vehicle: taken');
    const c = first.curves, last = c.count - 1, factors = ['mass', 'damping', 'stiffness'].map(n => c.at(`vehicle_${n}`, last));
    if (factors.some(f => Math.abs(f - 1) > 1e-9)) out.push(`vehicle's mass, damping, stiffness × ${factors.map(f => +f.toPrecision(3)).join(', ')}`);
    if (this.stands) out.push('time stands');
    if (this.drag && this.drag.force) out.push(`push of ${this.drag.force.length().toFixed(0)} N for ${element('seconds').value} s on release`);
    if (this.closed) {
      const folder = first.scene.results;
      out.push('the run is over, or its viewer has ended; this is what was seen');
      if (folder) out.push(`all of it: ./ves view ${folder}`);
    }
    return out;
  }

  /** Shift and the mouse: an arrow from what is under it, a force when it is let go. */
  touch() {
    const canvas = stage.canvas;
    this.arrow = new Arrow(ARROWS.push, 1);
    stage.world.add(this.arrow);
    canvas.addEventListener('pointerdown', event => {
      if (element('touch').hidden || !(event.shiftKey || element('hand').checked)) return;
      const on = element('pushed').value, frames = bodies[0].frames, frame = on === 'tool' ? frames.tool : frames[on];
      if (!frame) return;
      stage.controls.enabled = false;
      const place = this.place(event, on, frame);
      this.drag = {on, frame, local: frame.worldToLocal(place.clone()), from: [event.clientX, event.clientY], force: null};
      canvas.setPointerCapture(event.pointerId);
    }, true);
    canvas.addEventListener('pointermove', event => {
      if (!this.drag) return;
      // In the plane of the screen, as the mouse goes.
      const right = new THREE.Vector3(), up = new THREE.Vector3();
      stage.camera.matrixWorld.extractBasis(right, up, new THREE.Vector3());
      this.drag.force = right.multiplyScalar(NEWTONS * (event.clientX - this.drag.from[0]))
        .addScaledVector(up, -NEWTONS * (event.clientY - this.drag.from[1])).clampLength(0, MOST);
      const length = this.drag.force.length() * 0.02 * first.scene.size;
      this.arrow.visible = length > 0;
      this.arrow.position.copy(this.drag.frame.localToWorld(this.drag.local.clone()));
      if (length > 0) this.arrow.point(this.drag.force, length);
      show(shown);
    }, true);
    const end = push => {
      const d = this.drag;
      this.drag = null;
      stage.controls.enabled = true;
      this.arrow.visible = false;
      if (d && d.force && push) this.push(d.on, d.force.toArray(), parseFloat(element('seconds').value), d.local.toArray());
      show(shown);
    };
    canvas.addEventListener('pointerup', () => { if (this.drag) end(true); }, true);
    canvas.addEventListener('pointercancel', () => end(false), true);
  }
  push(on, force, seconds, at) {
    const text = numbers => numbers.map(x => +x.toPrecision(6)).join(' ');
    this.send(`push ${this.edition} ${on} ${text(force)} ${seconds} ${text(at)}`);
  }
  /** The point of the body under the mouse; its origin where the mouse is beside it. */
  place(event, on, frame) {
    const names = on === 'tool' ? ['tool'].concat(Object.keys(bodies[0].frames).filter(n => n.startsWith('link')).slice(-1)) : [on];
    const hit = stage.ray(event).intersectObjects(names.map(n => bodies[0].frames[n]).filter(Boolean), true)
      .find(h => h.object.isMesh && h.object.material.opacity > 0.5);
    return hit ? hit.point : frame.getWorldPosition(new THREE.Vector3());
  }
}
const factor = id => +Math.pow(10, parseFloat(element(id).value)).toPrecision(2);

if (window.VES_RECORDINGS.length) begin(window.VES_RECORDINGS.map(Recording.of));
else live = new Live();
requestAnimationFrame(step);
