// Charts of any column, or the difference of two ("leg1_commanded_m-leg1_measured_m"): one axis to
// the left, one to the right, one time for all. What is shown stands in the address, to be sent.
const UNITS = [  // how names of columns end, what the chart shows, times what
  ['_rad_per_s2', 'deg/s²', 180 / Math.PI], ['_m_per_s2', 'mm/s²', 1e3], ['_rad_per_s', 'deg/s', 180 / Math.PI],
  ['_m_per_s', 'mm/s', 1e3], ['_per_s', '1/s', 1], ['_rad', 'deg', 180 / Math.PI], ['_nm', 'N m', 1], ['_count', 'counts', 1],
  ['_ns', 'ns', 1], ['_m', 'mm', 1e3], ['_n', 'N', 1], ['_s', 'ms', 1e3], ['_j', 'J', 1], ['_v', 'V', 1], ['_c', '°C', 1]];
const STYLES = {actual: null, measured: [1, 3], commanded: [5, 4], base: [9, 4]};  // after what the name says
const DASHES = {actual: 'solid', measured: 'dotted', commanded: 'dashed', base: 'dashed'};
const OF_RUN = [null, [8, 3, 2, 3], [2, 3], [12, 3, 2, 3, 2, 3]];  // of several runs laid over each other
const LINES = 6;  // colours

/** Round numbers, three to seven of them, whatever the range. */
function ticks(low, high) {
  const power = Math.pow(10, Math.floor(Math.log10((high - low) / 3)));
  const step = [10, 5, 2, 1].map(m => m * power).find(s => (high - low) / s >= 3) || power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), out = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; ++k)
    out.push({v: k * step, label: Math.abs(k * step) >= 1e5 ? (k * step).toExponential(1) : (k * step).toFixed(Math.min(digits, 9))});
  return out;
}

class Charts {
  /** `pick(t)`: somebody clicked there. */
  constructor(host, pick) {
    this.host = host;
    this.pick = pick;
    this.charts = [];
    this.marks = [];
    this.over = null;
    this.more = document.createElement('div');
    this.more.className = 'more';
    const button = (text, title, act) => {
      const b = document.createElement('button');
      [b.textContent, b.title] = [text, title];
      b.addEventListener('click', act);
      this.more.appendChild(b);
    };
    button('+ chart', 'another chart', () => this.change(layout => layout.push([])));
    button('all of it', 'the whole time (or double click)', () => this.zoom(null));
    button('as at first', 'the charts that the page begins with', () => { this.window = null; this.build(this.first()); });
    this.choices = document.createElement('datalist');
    this.choices.id = 'columns';
    document.body.appendChild(this.choices);
  }
  /** `live`: what comes is added by extend(). */
  begin(recordings, live) {
    this.runs = recordings;
    this.live = live;
    this.marks = [];
    this.choices.textContent = '';
    for (const [name, column] of this.curves.columns) {
      if (!this.curves.known(name)) continue;
      const option = document.createElement('option');
      [option.value, option.label] = [name, column.meaning];
      this.choices.appendChild(option);
    }
    const address = new URLSearchParams(location.hash.slice(1));
    const zoom = (address.get('zoom') || '').split(',').map(Number);
    this.window = zoom.length === 2 && zoom[0] < zoom[1] ? zoom : null;
    const asked = (address.get('charts') || '').split(';').map(c => c.split(',').filter(name => this.parts(name)))
      .filter(c => c.length);
    this.build(asked.length ? asked : this.first());
  }
  get curves() { return this.runs[0].curves; }

  /** What a run is worth looking at for. */
  first() {
    const scene = this.runs[0].scene, knows = name => this.curves.known(name);
    const is = (this.live ? scene.simulated : knows('x_actual_m')) ? 'actual' : 'measured';
    const beside = scene.emulates && knows('x_base_m') ? 'base' : 'commanded';
    const pose = (names, unit) => [is, beside].flatMap(kind => names.map(n => `${n}_${kind}_${unit}`));
    const wanted = [
      pose(['x', 'y', 'z'], 'm'), pose(['alpha', 'beta', 'gamma'], 'rad'),
      ['fx_dynamic_n', 'fy_dynamic_n', 'fz_dynamic_n'], ['mx_dynamic_nm', 'my_dynamic_nm', 'mz_dynamic_nm'],
      ['fx_contact_n', 'fy_contact_n', 'fz_contact_n'],
      [1, 2, 3, 4, 5, 6].map(i => `leg${i}_commanded_m-leg${i}_measured_m`),
      ['late_s'], ['real_time_factor']];
    return wanted.map(c => c.filter(name => this.parts(name))).filter(c => c.length);
  }
  /** The column, or the two whose difference it is; null where there are none. */
  parts(name) {
    if (this.curves.known(name)) return [name];
    for (let k = name.indexOf('-'); k > 0; k = name.indexOf('-', k + 1)) {
      const pair = [name.slice(0, k), name.slice(k + 1)];
      if (pair.every(n => this.curves.known(n))) return pair;
    }
    return null;
  }
  unit(name) {
    const last = this.parts(name).slice(-1)[0];
    return UNITS.find(u => last.endsWith(u[0])) || ['', '', 1];
  }
  /** "x base" of x_base_m, and what it is called without actual, base, ... */
  label(name) {
    const short = n => { const u = UNITS.find(u => n.endsWith(u[0])); return u ? n.slice(0, -u[0].length) : n; };
    const parts = this.parts(name).map(short);
    if (parts.length === 2) {
      const [a, b] = parts.map(p => p.split('_'));
      const common = a.filter(w => b.includes(w)).join(' ');
      return {text: common || parts.join(' − '), stem: name, kind: 'actual'};
    }
    const words = parts[0].split('_'), kind = Object.keys(STYLES).find(k => words.includes(k)) || 'actual';
    const stem = words.filter(w => w !== kind && w !== 'dynamic').join(' ');
    return {text: kind === 'actual' ? stem : `${stem} ${kind}`, stem, kind};
  }
  get layout() { return this.charts.map(c => c.names); }
  change(edit) {
    const layout = this.layout.map(names => names.slice());
    edit(layout);
    this.build(layout);
  }
  build(layout) {
    for (const c of this.charts) if (c.chart) c.chart.destroy();
    this.charts = [];
    this.host.textContent = '';
    layout.forEach((names, k) => this.charts.push(this.chart(names, k)));
    this.host.appendChild(this.more);
    this.remember();
    this.hover(null);
    this.mark(this.time);
  }
  /** In the address, but for what the page begins with. */
  remember() {
    const parts = [], text = this.layout.filter(names => names.length).map(names => names.map(encodeURIComponent).join(',')).join(';');
    if (text !== this.first().map(names => names.map(encodeURIComponent).join(',')).join(';')) parts.push('charts=' + text);
    if (this.window) parts.push('zoom=' + this.window.map(t => t.toFixed(3)).join(','));
    try { history.replaceState(null, '', parts.length ? '#' + parts.join('&') : location.pathname + location.search); } catch (error) { /* of a file, in some browsers */ }
  }

  chart(names, k) {
    const place = document.createElement('div'), head = document.createElement('div'), plot = document.createElement('div');
    [place.className, head.className, plot.className] = ['chart', 'head', 'plot'];
    place.append(head, plot);
    this.host.appendChild(place);
    const units = [...new Set(names.map(n => this.unit(n)[1]))];
    const stems = [...new Set(names.map(n => this.label(n).stem))];
    const chips = names.map(name => {
      const {text, stem, kind} = this.label(name), chip = document.createElement('button');
      chip.className = 'chip';
      chip.title = `${name}: ${this.parts(name).map(n => this.curves.columns.get(n).meaning).join(' − ')}; click takes it out`;
      chip.style.color = `var(--c${stems.indexOf(stem) % LINES + 1})`;
      chip.style.borderTopStyle = DASHES[kind];
      const value = document.createElement('span');
      chip.append(text, value);
      chip.addEventListener('click', () => this.change(layout => {
        layout[k] = layout[k].filter(n => n !== name);
        if (!layout[k].length) layout.splice(k, 1);
      }));
      head.appendChild(chip);
      return value;
    });
    const unit = document.createElement('span');
    unit.className = 'unit';
    unit.textContent = units.filter(u => u).map((u, i) => (i ? `right: ${u}` : u)).join(', ');
    const add = document.createElement('input');
    [add.placeholder, add.title] = ['+ curve', 'a column of the run, or the difference of two: a-b'];
    add.setAttribute('list', 'columns');
    add.addEventListener('change', () => {
      const name = add.value.trim(), parts = this.parts(name);
      const fits = parts && new Set(names.concat(name).map(n => this.unit(n)[1])).size <= 2;
      add.setCustomValidity(!name || fits ? '' : parts ? 'a third unit: a chart has two axes' : 'no such column');
      if (!add.reportValidity() || !name || names.includes(name)) return;
      this.change(layout => layout[k].push(name));
    });
    head.append(unit, add);
    if (!names.length) {
      place.classList.add('empty');
      return {names, chips, place};
    }
    const one = {names, chips, place, rows: []};
    one.read = this.runs.map((run, r) => names.map(name => {
      const parts = this.parts(name), factor = this.unit(name)[2], curves = run.curves;
      if (!parts.every(n => curves.has(n))) return () => NaN;
      return parts.length === 1 ? i => factor * curves.at(parts[0], i)
                                : i => factor * (curves.at(parts[0], i) - curves.at(parts[1], i));
    }));
    one.row = i => [this.curves.t[i]].concat(one.read[0].map(read => read(i)));
    one.rows = this.runs.length === 1 ? Array.from({length: this.curves.count}, (_, i) => one.row(i)) : this.merged(one);
    const labels = ['t'], series = {}, colours = [];
    this.runs.forEach((run, r) => names.forEach((name, j) => {
      const {stem, kind} = this.label(name), label = `${r} ${name}`;
      labels.push(label);
      colours.push(colourOf(`--c${stems.indexOf(stem) % LINES + 1}`));
      series[label] = {strokePattern: r ? OF_RUN[r % OF_RUN.length] : STYLES[kind], strokeWidth: kind === 'actual' ? 1.5 : 1.3,
                       axis: units.indexOf(this.unit(name)[1]) === 1 ? 'y2' : 'y'};
    }));
    one.chart = new Dygraph(plot, one.rows.length ? one.rows : [labels.map(() => 0)], {
      labels, series, colors: colours, legend: 'never', axisLabelFontSize: 11, gridLineColor: '#88888840', strokeWidth: 1.4,
      connectSeparatedPoints: this.runs.length > 1, dateWindow: this.window, labelsKMB: false, highlightCircleSize: 2,
      axes: {x: {axisLabelFormatter: t => `${+t.toFixed(3)}`}, y: {ticker: ticks, axisLabelWidth: 46}, y2: {ticker: ticks, axisLabelWidth: 46, independentTicks: true, drawGrid: false}},
      underlayCallback: (context, area, g) => this.drawMarks(context, area, g, k === 0),
      zoomCallback: (low, high) => this.zoom(one.chart.isZoomed('x') ? [low, high] : null),
      highlightCallback: (event, t) => this.hover(t), unhighlightCallback: () => this.hover(null),
      clickCallback: (event, t) => this.pick(t), drawCallback: (g, initial) => { if (!initial) this.mark(this.time); }});
    one.cursors = ['cursor', 'cursor hover'].map(name => {
      const line = document.createElement('div');
      line.className = name;
      plot.appendChild(line);
      return line;
    });
    return one;
  }
  /** Rows of several runs, each at its own times. */
  merged(one) {
    const places = [], width = one.names.length, all = 1 + width * this.runs.length;
    this.runs.forEach((run, r) => { for (let i = 0; i < run.curves.count; ++i) places.push([run.curves.t[i], r, i]); });
    places.sort((a, b) => a[0] - b[0]);
    const rows = [];
    for (const [t, r, i] of places) {
      let row = rows[rows.length - 1];
      if (!row || t - row[0] > 1e-5) rows.push(row = [t].concat(new Array(all - 1).fill(null)));
      one.read[r].forEach((read, j) => { row[1 + r * width + j] = read(i); });
    }
    return rows;
  }

  /** A live tick more, and those that are too old. */
  extend(i) { for (const c of this.charts) if (c.chart) c.rows.push(c.row(i)); }
  drop(count) { for (const c of this.charts) if (c.chart) c.rows.splice(0, count); }
  redraw() { for (const c of this.charts) if (c.chart && c.rows.length) c.chart.updateOptions({file: c.rows}); }
  resize() { for (const c of this.charts) if (c.chart) c.chart.resize(); }
  theme() { if (this.runs) this.build(this.layout); }

  zoom(window) {
    this.window = window;
    for (const c of this.charts) if (c.chart) c.chart.updateOptions({dateWindow: window, valueRange: null});
    this.remember();
  }
  /** The time that the scene shows. */
  mark(t) {
    this.time = t;
    this.place(0, t);
    if (this.over === null) this.tell(t);
  }
  place(which, t) {
    for (const c of this.charts) {
      if (!c.chart) continue;
      const x = t === undefined || t === null ? NaN : c.chart.toDomXCoord(t), area = c.chart.getArea();
      c.cursors[which].hidden = !(x >= area.x && x <= area.x + area.w);
      c.cursors[which].style.left = `${x}px`;
    }
  }
  /** The time that the mouse is over; null: none, and what is told is that of the scene. */
  hover(t) {
    this.over = t;
    this.place(1, t);
    this.tell(t === null ? this.time : t);
  }
  /** Values at that time, in every chart. */
  tell(t) {
    const i = t === undefined ? -1 : lastAt(this.curves.count, k => this.curves.t[k], t + 1e-6);
    for (const c of this.charts)
      c.chips.forEach((chip, j) => {
        const y = i < 0 || !c.read ? NaN : c.read[0][j](i);
        chip.textContent = isNaN(y) ? '' : Math.abs(y) < 1e-9 ? '0' : Math.abs(y) < 0.001 ? y.toExponential(1) : +y.toPrecision(3);
      });
  }
  /** What begins at t. */
  begins(t, text) { this.marks.push({t, text}); }
  /** Lines where segments begin; their names in the first chart. */
  drawMarks(context, area, chart, named) {
    context.save();
    context.strokeStyle = '#88888888';
    context.fillStyle = colourOf('--soft');
    context.font = '10px system-ui, sans-serif';
    let free = -Infinity;
    for (const m of this.marks) {
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
}
