// One page: the scene at one time, the charts beside it, and time that goes on.
const stage = new Stage();
let first = null, bodies = [], live = null, shown = 0;
const charts = new Charts(element('charts'), t => { play(false); show(first.at(t)); });
const COUPLES = 16;  // bit of the first in thrusters_on
const nameOf = (list, i) => first.scene[list][Math.round(i)] || '';

/** A line where picture i begins something. */
function markAt(i) {
  const what = k => `${first.scalar(k, 'phase')} ${first.scalar(k, 'segment')}`;
  if (i > 0 && what(i) === what(i - 1)) return;
  const kind = nameOf('kinds', first.scalar(i, 'kind')), phase = nameOf('phases', first.scalar(i, 'phase'));
  charts.begins(first.time(i), phase === 'running' ? kind : phase);
}

/** A page of these from here on; the first leads. */
function begin(recordings) {
  bodies.forEach(b => b.remove());
  [shown, first] = [0, recordings[0]];
  bodies = recordings.map((r, k) => new Bodies(r, stage.world, k ? {colour: [0, 0x3a7ca5, 0x7a8a3a, 0x8a5a7a][k % 4], opacity: 0.45} : {}));
  charts.begin(recordings, live !== null);
  first.pictures.forEach((_, i) => markAt(i));
  charts.redraw();
  charts.resize();
  for (const place of document.querySelectorAll('.arm')) place.hidden = first.scene.arm.length < 2;
  // Where the tool may touch something, gaps would not be what they are.
  element('times').disabled = first.scene.shapes.some(s => s.world);
  element('times').title = element('times').disabled ? 'not where the tool may touch something' : 'every motion so much larger';
  if (element('times').disabled) element('times').value = 0;
  const b = bodies[0].frames, [edge, twin] = bodies[0].edges, named = [['platform', edge], ['base in free space', twin, 'ghost']];
  if (b.tool) named.push(['tool', b.tool]);
  if (b.target) named.push(['target', b.target]);
  if (b.compass) named.push(['axes of the flight', b.compass]);
  stage.label(named);
  document.title = first.scene.name;
  element('seek').max = Math.max(0, first.count - 1);
  stage.begin(first.scene);
  if (first.count) show(first.at(0));
}

const times = () => Math.round(Math.pow(10, parseFloat(element('times').value)));

/** One picture. */
function show(i) {
  if (!first || !first.count) return;
  shown = Math.max(0, Math.min(first.count - 1, i));
  const t = first.time(shown), newtonsPerMetre = 1000 * Math.pow(Math.min(first.scene.size, 1), 2) / Math.pow(10, parseFloat(element('force').value));
  const how = {ghost: element('ghost').checked, trail: element('trail').checked, newtonsPerMetre, times: times()};
  bodies.forEach((b, k) => b.place(k ? b.recording.at(t) : shown, how));
  const phase = nameOf('phases', first.scalar(shown, 'phase')), segment = first.scalar(shown, 'segment');
  const kind = nameOf('kinds', first.scalar(shown, 'kind')), cause = nameOf('checks', first.scalar(shown, 'cause'));
  const lines = [`${phase}${phase === 'running' && kind ? ': ' + kind : ''}${segment >= 0 && segment < first.scene.segments.length ? ` (${segment + 1} of ${first.scene.segments.length})` : ''}`];
  if (cause) lines.push(`stopped by: ${cause}`);
  if (live) lines.push(...live.lines(shown));
  if (bodies[0].frames.compass)
    lines.push(`the laboratory flies along: ${first.scalar(shown, 'flown').toFixed(2)} m from its start, turning at ${first.scalar(shown, 'turns_at').toFixed(1)} deg/s`);
  const couples = ['x', 'y', 'z'].filter((_, k) => first.scalar(shown, 'thrusters_on') >> COUPLES + k & 1);
  if (couples.length) lines.push(`couples about ${couples.join(', ')} hold the attitude`);
  if (bodies[0].wheels.length)
    lines.push(`wheels have taken ${bodies[0].wheels.map((_, k) => first.scalar(shown, `wheel${k}_momentum`).toFixed(2)).join(', ')} N m s`);
  const arrows = Object.keys(ARROWS).filter(name => bodies[0].arrows[name].visible);
  if (arrows.length) lines.push(`${arrows.join(', ')}: 1 m is ${newtonsPerMetre < 10 ? newtonsPerMetre.toFixed(1) : Math.round(newtonsPerMetre)} N`);
  if (how.times > 1) lines.push(`every motion times ${how.times}`);
  const words = element('words'), head = document.createElement('b');
  words.textContent = '';
  head.textContent = first.scene.name;
  words.append(head, '\n' + lines.join('\n'));
  bodies.forEach((b, k) => {
    if (bodies.length > 1) words.append(`\n${k ? 'pale, dash-dotted' : 'solid'}: ${b.recording.scene.label}`);
  });
  element('time').textContent = live ? `${t.toFixed(2)} s` : `${t.toFixed(2)} of ${first.time(first.count - 1).toFixed(2)} s`;
  element('seek').value = shown;
  charts.mark(t);
  stage.dirty = true;
}

// Time goes on.
let playing = false, clock = 0, since = 0;
function play(on) {
  if (!first) return;
  playing = on && (live !== null || first.count > 1);
  if (playing && !live && shown === first.count - 1) show(0);
  clock = first.count ? first.time(shown) : 0;
  since = performance.now();
  element('play').textContent = playing ? 'pause' : live ? 'newest' : 'play';
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
  stage.draw();
  requestAnimationFrame(step);
}
element('seek').addEventListener('input', () => { play(false); show(parseInt(element('seek').value, 10)); });
element('play').addEventListener('click', () => play(!playing));
element('back').addEventListener('click', () => { play(false); show(shown - 1); });
element('forth').addEventListener('click', () => { play(false); show(shown + 1); });
for (const id of ['ghost', 'trail', 'labels']) element(id).addEventListener('change', () => { show(shown); stage.dirty = true; });
for (const id of ['force', 'times']) element(id).addEventListener('input', () => show(shown));
for (const button of document.querySelectorAll('[data-view]'))
  button.addEventListener('click', () => { if (first) stage.look(button.dataset.view); });
const root = document.documentElement;
root.dataset.theme = window.matchMedia && matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
element('theme').addEventListener('click', () => {
  root.dataset.theme = root.dataset.theme === 'dark' ? 'light' : 'dark';
  charts.theme();
  stage.dirty = true;
});
document.addEventListener('keydown', event => {
  if (event.target.tagName === 'INPUT' && event.target.type !== 'range') return;
  if (event.key === ' ') { play(!playing); event.preventDefault(); }
  if (event.key === 'ArrowLeft') { play(false); show(shown - 1); }
  if (event.key === 'ArrowRight') { play(false); show(shown + 1); }
});
window.addEventListener('resize', () => charts.resize());

/** For tests and films: what the page shows now, read back from the objects that are drawn. */
window.ves = {
  get count() { return first ? first.count : 0; },
  get live() { return live; },
  get words() { return element('words').textContent; },
  get layout() { return charts.layout; },
  show,
  /** The picture of time t, drawn before it returns. */
  film: t => { play(false); show(first.at(t)); stage.draw(); },
  look: view => stage.look(view),
  time: () => first.time(shown),
  end: () => first.time(first.count - 1),
  pace: () => first.scalar(first.count - 1, 'pace'),
  charted: () => charts.charts.length ? charts.charts[0].rows.map(row => row[0]) : [],
  chart: k => charts.charts[k],
  window: () => charts.charts.map(c => c.chart.xAxisRange()),
  /** Where in the window a point of a frame is seen [px]. */
  seen: name => {
    const at = new THREE.Vector3().setFromMatrixPosition(bodies[0].frames[name].matrixWorld).project(stage.camera);
    const box = stage.canvas.getBoundingClientRect();
    return [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
  },
  position: name => {
    stage.world.updateMatrixWorld(true);
    return new THREE.Vector3().setFromMatrixPosition(bodies[0].frames[name].matrixWorld).toArray();
  },
  matrix: name => {
    stage.world.updateMatrixWorld(true);
    return bodies[0].frames[name].matrixWorld.toArray();
  }};
