// SPDX-License-Identifier: Apache-2.0
import uPlot from 'uplot';
import {colours, onScheme} from './colours.js';
import {lengthText, roundDown, roundUp, shown, tickText} from './data.js';
import {check, choice, element, select} from './elements.js';

const height = 270;
const panelHeight = 170;  // of two histograms, one above the other
// One of two that are drawn over the same classes is a single bar where the other reaches this many times as far.
const apart = 8;
const font = '12px system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';

const least = (values) => values.reduce((a, b) => Math.min(a, b), Infinity);
const most = (values) => values.reduce((a, b) => Math.max(a, b), -Infinity);

const ruler = document.createElement('canvas').getContext('2d');
const textWidth = (text) => {
  ruler.font = font;
  return ruler.measureText(text).width;
};

/** Values that many poses share are spread a little, so that no pose hides another. */
function spread(values) {
  const kinds = new Set(values).size;
  const range = most(values) - least(values);
  if (kinds > 12 || kinds * 4 > values.length || !(range > 0)) return values;
  // Fractions of the golden ratio: even, and the same each time.
  return values.map((v, k) => v + ((k * 0.618034) % 1 - 0.5) * 0.05 * range);
}

/** Ticks of a logarithmic axis: its ends, then powers of ten, then 2 and 5 times these, as far as their texts have room. */
function logTicks(low, high, length, across) {
  const decades = [];
  for (let e = Math.floor(Math.log10(low) + 1e-9); 10 ** e <= high * 1.001; ++e) {
    for (const lead of [1, 2, 5]) decades.push({v: Number(`${lead}e${e}`), rank: lead === 1 ? 1 : 2});
  }
  const ticks = decades.filter(({v}) => v >= low * 0.999 && v <= high * 1.001);
  if (ticks.length > 0) ticks[0].rank = ticks[ticks.length - 1].rank = 0;
  const kept = [];
  for (const {v} of ticks.sort((a, b) => a.rank - b.rank || a.v - b.v)) {
    const room = (w) => (across ? (textWidth(tickText(v)) + textWidth(tickText(w))) / 2 + 8 : 14);
    if (kept.every((w) => (Math.abs(Math.log(v / w)) / Math.log(high / low)) * length >= room(w))) kept.push(v);
  }
  return kept.sort((a, b) => a - b);
}

/** Errors of a set against whatever was recorded, and their distribution. */
export class Explorer {
  /** @param {?(pose: number) => void} chosen  a pose was clicked; nothing where there is no view that goes there */
  constructor(at, set, chosen) {
    this.set = set;
    this.chosen = chosen;
    this.kind = 'size';
    this.against = 0;
    this.which = 'both';
    this.log = set.startsLogarithmic('size');
    this.pose = -1;  // chosen
    this.near = -1;  // read
    this.scatter = null;
    this.histograms = [];
    const kinds = [['size', 'length of the position error'], ['x', 'x'], ['y', 'y'], ['z', 'z']];
    if (set.turned) kinds.push(['turned', 'angle of the orientation error']);
    this.scatterAt = element('div', {class: 'chart scatter', role: 'group', tabindex: 0,
      onkeydown: (event) => this.key(event)});
    this.histogramAt = element('div', {class: 'chart histogram', role: 'img'});
    this.readout = element('p', {class: 'note readout', role: 'status'});
    this.about = element('span');
    this.logBox = check('logarithmic', this.log, (on) => { this.log = on; this.draw(); });
    at.append(
      element('h3', {}, 'Errors against each joint and whatever else was recorded'),
      element('div', {class: 'controls'},
        select('error', kinds, this.kind, (kind) => {
          this.kind = kind;
          this.log = set.startsLogarithmic(kind);
          this.draw();
        }),
        select('against', set.covariates.map((c, k) => [String(k), c.name]), '0', (k) => {
          this.against = Number(k);
          this.draw();
        }),
        choice('poses', [['before', 'before'], ['both', 'both'], ['after', 'after']], this.which, (which) => {
          this.which = which;
          this.draw();
        }),
        this.logBox),
      element('div', {class: 'charts'}, this.scatterAt, this.histogramAt),
      this.readout,
      element('p', {class: 'note'}, 'Noise has no shape; a curve or a slope is an effect that the model does not have. ',
        ...(set.count < set.total
          ? [`${set.count} of ${set.total} poses are drawn, the largest errors and an even part of the others; the histogram counts all. `] : []),
        ...(set.outlier.size > 0 ? ['A diamond: it lies far from the rest. '] : []),
        'Components are those of the frame of the measurement. ', this.about));
    this.hint();
    this.draw();
    new ResizeObserver(() => this.resize()).observe(this.scatterAt);
    onScheme(() => this.draw());
  }

  hint() {
    this.readout.textContent = `Point at a dot to read it, or go from dot to dot with the arrow keys${
      this.chosen ? '; click, and the arm above goes there' : ''}.`;
  }

  get signed() {
    return ['x', 'y', 'z'].includes(this.kind);
  }

  /** A logarithmic axis has no place for what may be negative. */
  get canBeLog() {
    return !this.signed && this.set.histogram(this.kind, this.which, true) !== null;
  }

  get isLog() {
    return this.log && this.canBeLog;
  }

  get unit() {
    return this.kind === 'turned' ? 'deg' : 'mm';
  }

  get shown() {
    return this.which === 'both' ? ['before', 'after'] : [this.which];
  }

  /** "x of the position error [mm]" */
  get name() {
    return `${this.signed ? `${this.kind} of the ` : ''}${this.kind === 'turned' ? 'orientation' : 'position'} error [${this.unit}]`;
  }

  text(v) {
    return this.kind === 'turned' ? `${shown(v)} deg` : lengthText(v);
  }

  options(at, c, {x, y, tall, logX = false, logY = false, xRange, yRange, whole = false, series, hooks}) {
    const axis = (label, more) => ({
      label, labelFont: font, font, stroke: c.soft, labelSize: 20, labelGap: 2,
      grid: {stroke: c.grid, width: 1}, ticks: {stroke: c.axis, width: 1, size: 4},
      values: (u, splits) => splits.map(tickText), ...more,
    });
    const log = (length, across) => ({
      splits: (u, index, low, high) => logTicks(low, high, length(u), across), filter: (u, splits) => splits,
    });
    return {
      width: Math.max(at.clientWidth, 200), height: tall, legend: {show: false}, padding: [10, 16, 0, 0],
      cursor: {drag: {x: false, y: false}, points: {show: false}, y: false, x: false},
      scales: {
        x: {time: false, distr: logX ? 3 : 1, range: xRange},
        y: {distr: logY ? 3 : 1, range: yRange},
      },
      axes: [
        axis(x, {
          size: 34,
          space: (u, index, low, high) => 24 + Math.max(...[low, high].map((v) => textWidth(tickText(Number(v.toPrecision(3)))))),
          ...(logX ? log((u) => u.width - 80, true) : {}),
        }),
        axis(y, {
          // As wide as its longest text.
          size: (u, values) => 12 + Math.max(24, ...(values ?? []).map(textWidth)),
          ...(whole ? {incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 100000]} : {}),
          ...(logY ? log(() => tall - 70, false) : {}),
        }),
      ],
      series: [{label: x}, ...series],
      hooks,
    };
  }

  draw() {
    this.scatter?.destroy();
    for (const plot of this.histograms) plot.destroy();
    this.near = -1;
    const box = this.logBox.querySelector('input');
    box.disabled = !this.canBeLog;
    box.checked = this.isLog;
    const c = colours();
    this.scatter = this.drawScatter(c);
    this.histograms = this.drawHistograms(c);
  }

  drawScatter(c) {
    const {set} = this;
    const covariate = set.covariates[this.against];
    const at = spread(Array.from(covariate.values));
    const log = this.isLog;
    this.order = at.map((_, k) => k).sort((a, b) => at[a] - at[b]);
    this.values = {before: set.quantity('before', this.kind), after: set.quantity('after', this.kind)};
    const drawn = this.shown;
    const noughts = log ? drawn.reduce((n, which) => n + this.values[which].filter((v) => !(v > 0)).length, 0) : 0;
    this.about.textContent = noughts > 0 ? `Errors of 0 (${noughts}) lie on the lower edge.` : '';
    const columns = drawn.map((which) => this.order.map((k) => (log && !(this.values[which][k] > 0) ? null : this.values[which][k])));
    const extent = (low, high) => {
      const margin = high > low ? 0.03 * (high - low) : 1;
      return [low - margin, high + margin];
    };
    const options = this.options(this.scatterAt, c, {
      x: covariate.name, y: this.name, tall: height, logY: log,
      xRange: (u, low, high) => extent(low, high),
      yRange: (u, low, high) => {
        // From one round number to another.
        if (log) return low > 0 ? [roundDown(low), Math.max(roundUp(high), 2 * roundDown(low))] : [0.1, 1];
        const margin = high > low ? 0.06 * (high - low) : Math.max(Math.abs(high), 1e-6);
        return this.signed ? [low - margin, high + margin] : [0, high + margin];
      },
      series: drawn.map((which) => ({label: which, stroke: c[which], paths: () => null, points: {show: false}})),
      hooks: {
        setCursor: [(u) => this.point(u)],
        ready: [(u) => u.over.addEventListener('click', () => this.take())],
        draw: [(u) => {
          this.drawFloor(u, c, 'y');
          this.drawDots(u, c);
          if (u === this.scatter) this.mark();  // only now it is known where the dots are
        }],
      },
    });
    const range = (which) => `${which} ${this.text(least(this.values[which]))} to ${this.text(most(this.values[which]))}`;
    this.scatterAt.setAttribute('aria-label', `${this.name} against ${covariate.name}, ${set.count} poses: ${
      drawn.map(range).join(', ')}. Arrow keys go from dot to dot.`);
    this.scatterAt.replaceChildren();
    const plot = new uPlot(options, [this.order.map((k) => at[k]), ...columns], this.scatterAt);
    this.rings = {found: [], chosen: []};
    for (const kind of ['chosen', 'found']) {
      this.rings[kind] = drawn.map(() => element('span', {class: `ring ${kind}`, hidden: true}));
      plot.over.append(...this.rings[kind]);
    }
    return plot;
  }

  /** Where dot n of the order is, in the pixels of uPlot's frame or, `onCanvas`, those of its canvas. */
  place(u, s, n, onCanvas) {
    const y = u.data[s + 1][n];
    const low = onCanvas ? u.bbox.top + u.bbox.height : u.over.clientHeight;
    return [u.valToPos(u.data[0][n], 'x', onCanvas), y === null ? low : u.valToPos(y, 'y', onCanvas)];
  }

  /** By hand: a dot on the edge is a whole one, and those that lie far from the rest have a diamond. */
  drawDots(u, c) {
    const {ctx} = u;
    const {devicePixelRatio: unit} = window;
    const radius = (this.set.count > 400 ? 1.5 : 3) * unit;
    ctx.save();
    this.shown.forEach((which, s) => {
      ctx.fillStyle = c[which];
      ctx.strokeStyle = c.ink;
      ctx.lineWidth = 1.5 * unit;
      ctx.beginPath();
      for (let n = 0; n < this.order.length; ++n) {
        const [x, y] = this.place(u, s, n, true);
        ctx.moveTo(x + radius, y);
        ctx.arc(x, y, radius, 0, 2 * Math.PI);
      }
      ctx.fill();
      ctx.beginPath();
      this.order.forEach((pose, n) => {
        if (!this.set.outlier.has(pose)) return;
        const [x, y] = this.place(u, s, n, true);
        const arm = 7 * unit;
        [[0, -arm], [arm, 0], [0, arm], [-arm, 0]].forEach(([dx, dy], k) => (k === 0 ? ctx.moveTo(x + dx, y + dy) : ctx.lineTo(x + dx, y + dy)));
        ctx.closePath();
      });
      ctx.stroke();
    });
    ctx.restore();
  }

  /** The noise, where it can be seen: nothing can be below it for long. */
  drawFloor(u, c, scale) {
    if (this.kind !== 'size' || !(this.set.floor > 0)) return;
    const at = u.valToPos(this.set.floor, scale, true);
    const {left, top, width, height: tall} = u.bbox;
    if (scale === 'y' ? at < top || at > top + tall : at < left || at > left + width) return;
    const {ctx} = u;
    ctx.save();
    ctx.strokeStyle = c.floor;
    ctx.fillStyle = c.floor;
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.beginPath();
    if (scale === 'y') { ctx.moveTo(left, at); ctx.lineTo(left + width, at); }
    else { ctx.moveTo(at, top); ctx.lineTo(at, top + tall); }
    ctx.stroke();
    ctx.textAlign = scale === 'y' ? 'right' : 'left';
    ctx.textBaseline = 'alphabetic';
    if (scale === 'y') ctx.fillText('noise', left + width - 3 * devicePixelRatio, at - 4 * devicePixelRatio);
    else ctx.fillText('noise', at + 3 * devicePixelRatio, top + 12 * devicePixelRatio);
    ctx.restore();
  }

  /** The dot nearest to the pointer. */
  point(u) {
    const {left, top} = u.cursor;
    let best = 24 ** 2;
    let found = -1;
    for (let s = 0; left >= 0 && s < this.shown.length; ++s) {
      for (let n = 0; n < this.order.length; ++n) {
        const [x, y] = this.place(u, s, n, false);
        const d = (x - left) ** 2 + (y - top) ** 2;
        if (d < best) { best = d; found = this.order[n]; }
      }
    }
    this.read(found);
  }

  /** Says what a pose is, and rings it. */
  read(pose) {
    if (pose === this.near) return;
    this.near = pose;
    this.mark();
    if (pose < 0) {
      this.hint();
      return;
    }
    const {set} = this;
    const covariate = set.covariates[this.against];
    this.readout.replaceChildren(element('b', {}, `Pose ${set.number[pose]}`),
      set.line.length > 0 ? ` (line ${set.line[pose]})` : '',
      `: ${covariate.name} ${shown(covariate.values[pose])}; before ${this.text(this.values.before[pose])}, `
        + `after ${this.text(this.values.after[pose])}`,
      set.outlier.has(pose) ? '; lies far from the rest and does not count in full' : '');
  }

  key(event) {
    const by = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
    if (by) {
      const now = this.order.indexOf(this.near >= 0 ? this.near : this.pose);
      const next = now < 0 ? 0 : (now + by + this.order.length) % this.order.length;
      this.read(this.order[next]);
    } else if (event.key === 'Enter' || event.key === ' ') {
      this.take();
    } else {
      return;
    }
    event.preventDefault();
  }

  /** The pose that is read becomes the chosen one. */
  take() {
    if (this.near < 0) return;
    if (this.chosen) this.chosen(this.near);  // and the view tells where it went
    else this.choose(this.near);
  }

  choose(pose) {
    this.pose = pose;
    this.mark();
  }

  mark() {
    for (const [kind, pose] of [['found', this.near], ['chosen', this.pose]]) {
      const n = pose < 0 ? -1 : this.order.indexOf(pose);
      this.rings[kind].forEach((ring, s) => {
        ring.hidden = n < 0;
        if (n < 0) return;
        const [x, y] = this.place(this.scatter, s, n, false);
        ring.style.left = `${x}px`;
        ring.style.top = `${y}px`;
      });
    }
  }

  drawHistograms(c) {
    const {set, kind} = this;
    const log = this.isLog;
    const alone = (which) => set.histogram(kind, which, log);
    let parts = [alone(this.which)];
    if (this.which === 'both' && !log) {
      const [before, after] = ['before', 'after'].map(alone);
      const ratio = (before.high - before.low) / (after.high - after.low);
      if (ratio > apart || ratio < 1 / apart) parts = [before, after];
    }
    const steps = uPlot.paths.stepped({align: 1});
    this.histogramAt.replaceChildren();
    this.histogramAt.setAttribute('aria-label', `Histogram of the ${this.name} of ${set.total} pose${set.total === 1 ? '' : 's'}: ${
      parts.flatMap((part) => Object.entries(part.counts).map(([which, counts]) => {
        const peak = counts.indexOf(most(counts));
        return `${which} most often from ${this.text(part.edges[peak])} to ${this.text(part.edges[peak + 1])}`;
      })).join(', ')}`);
    return parts.map((part) => {
      const names = Object.keys(part.counts);
      const options = this.options(this.histogramAt, c, {
        x: parts.length > 1 ? `${names[0]}: ${this.name}` : this.name, y: 'poses',
        tall: parts.length > 1 ? panelHeight : height, logX: log, whole: true,
        xRange: () => [part.low, part.high],
        yRange: (u, low, high) => [0, Math.max(1, 1.06 * high)],
        series: names.map((which) => ({label: which, stroke: c[which], fill: `${c[which]}55`, width: 1.5, paths: steps, points: {show: false}})),
        hooks: {draw: [(u) => this.drawFloor(u, c, 'x')]},
      });
      // The last one closes the steps.
      return new uPlot(options, [part.edges, ...names.map((which) => [...part.counts[which], 0])], this.histogramAt);
    });
  }

  resize() {
    const fit = (plot, at) => {
      if (at.clientWidth > 0 && Math.abs(at.clientWidth - plot.width) > 1) plot.setSize({width: at.clientWidth, height: plot.height});
    };
    fit(this.scatter, this.scatterAt);
    for (const plot of this.histograms) fit(plot, this.histogramAt);
    this.mark();
  }
}
