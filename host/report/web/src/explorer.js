import uPlot from 'uplot';
import {colours, onColours} from './colours.js';
import {roundDown, roundUp, shown} from './data.js';
import {check, choice, element, select} from './elements.js';

// As plots.cpp: a logarithmic axis where one number is this many times another.
const logFromRatio = 8;
const height = 270;

const mean = (values) => values.reduce((sum, v) => sum + v, 0) / Math.max(values.length, 1);
const least = (values) => values.reduce((a, b) => Math.min(a, b), Infinity);
const most = (values) => values.reduce((a, b) => Math.max(a, b), -Infinity);

/** Values that many poses share are spread a little, so that no pose hides another. */
function spread(values) {
  const kinds = new Set(values).size;
  const range = most(values) - least(values);
  if (kinds > 12 || kinds * 4 > values.length || !(range > 0)) return values;
  // Fractions of the golden ratio: even, and the same each time.
  return values.map((v, k) => v + ((k * 0.618034) % 1 - 0.5) * 0.05 * range);
}

/** Edges of the classes of a histogram, as plots.cpp chooses them. */
function classes(before, after, log) {
  const all = [...before, ...after];
  let high = most(all);
  if (!(high > 0)) high = 1;
  const count = Math.round(Math.min(Math.max(2 * Math.cbrt(before.length) + 8, 12), 40));
  const positive = all.filter((v) => v > 0);
  // With round ends, as the axis has them. One lucky pose near zero must not press all the others together.
  const low = log ? roundDown(Math.max(least(positive), mean(after) / 30)) : Math.min(least(all), 0);
  if (log) high = roundUp(high);
  return Array.from({length: count + 1}, (_, k) =>
    log ? low * (high / low) ** (k / count) : low + ((high - low) * k) / count);
}

function counted(values, edges) {
  const counts = new Array(edges.length).fill(0);  // the last one closes the steps
  for (const v of values) {
    let k = edges.findIndex((edge) => edge > v) - 1;
    if (k === -2) k = edges.length - 2;
    counts[Math.max(k, 0)] += 1;
  }
  return counts;
}

/** Errors of a set against whatever was recorded, and their distribution. */
export class Explorer {
  /** @param {(pose: number) => void} chosen  a pose was clicked */
  constructor(at, set, chosen) {
    this.set = set;
    this.chosen = chosen;
    this.kind = 'size';
    this.against = 0;
    this.which = 'both';
    this.log = this.spans();
    this.plots = [];
    const kinds = [['size', 'length of the position error'], ['x', 'x'], ['y', 'y'], ['z', 'z']];
    if (set.turned) kinds.push(['turned', 'angle of the orientation error']);
    this.scatterAt = element('div', {class: 'chart scatter'});
    this.histogramAt = element('div', {class: 'chart histogram'});
    this.readout = element('p', {class: 'note readout'});
    this.logBox = check('logarithmic', this.log, (on) => { this.log = on; this.draw(); });
    at.append(
      element('h3', {}, 'Errors against each joint and whatever else was recorded'),
      element('div', {class: 'controls'},
        select('error', kinds, this.kind, (kind) => {
          this.kind = kind;
          this.log = this.spans();
          this.logBox.querySelector('input').checked = this.log;
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
        ...(set.count < set.total ? [`${set.count} of ${set.total} poses are drawn. `] : []),
        'Components are those of the frame of the measurement.'));
    this.hint();
    this.draw();
    new ResizeObserver(() => this.resize()).observe(this.scatterAt);
    onColours(() => this.draw());
  }

  hint() {
    this.readout.textContent = 'Point at a dot to read it; click, and the arm above goes there.';
  }

  get signed() {
    return ['x', 'y', 'z'].includes(this.kind);
  }

  /** Whether a linear axis would press one of the two onto zero. */
  spans() {
    if (['x', 'y', 'z'].includes(this.kind)) return false;
    const before = this.set.quantity('before', this.kind);
    const after = this.set.quantity('after', this.kind);
    const usual = mean(after);
    return usual > 0 && Math.max(most(before), most(after)) / usual > logFromRatio;
  }

  series(which, ink, more) {
    const small = this.set.count > 400;
    return {
      label: which, stroke: ink, width: 1.5, show: this.which === 'both' || this.which === which,
      points: {show: true, space: 0, size: small ? 3 : 6, width: 0, fill: ink, stroke: ink},
      ...more,
    };
  }

  options(at, c, {x, y, log, logX, series, hooks, yCounts}) {
    const font = '12px system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
    const axis = (label, more) => ({
      label, labelFont: font, font, stroke: c.soft, labelSize: 20, labelGap: 2,
      grid: {stroke: c.grid, width: 1}, ticks: {stroke: c.axis, width: 1, size: 4}, ...more,
    });
    const plain = (u, splits) => splits.map((v) => (v === null ? '' : String(Number(v.toPrecision(6)))));
    // Of each decade 1, 2 and 5 are named where there is room, else 1 alone.
    const decades = (u, splits, axis) => {
      const scale = u.scales[u.axes[axis].scale];
      const room = (axis === 0 ? u.width - 64 : 3 * (height - 64)) / Math.log10(scale.max / scale.min);
      const named = room > 120 ? /^[125]\.0+e/ : /^1\.0+e/;
      return splits.map((v) => (v !== null && named.test(v.toExponential(6)) ? v : null));
    };
    const log125 = {filter: decades, grid: {stroke: c.grid, width: 1, filter: decades},
      ticks: {stroke: c.axis, width: 1, size: 4, filter: decades}};
    // From one round number to another.
    const logRange = (u, low, high) => (low > 0 ? [roundDown(low), roundUp(high)] : [0.1, 1]);
    return {
      width: Math.max(at.clientWidth, 200), height, legend: {show: false}, padding: [10, 12, 0, 0],
      cursor: {drag: {x: false, y: false}, points: {show: false}, y: false, x: false},
      scales: {
        x: {time: false, distr: logX ? 3 : 1, range: logX ? logRange : (u, low, high) => {
          const margin = high > low ? 0.03 * (high - low) : 1;
          return hooks.stepped ? [low, high] : [low - margin, high + margin];
        }},
        y: {distr: log ? 3 : 1, range: log ? logRange : (u, low, high) => {
          const margin = (high > low ? 0.06 * (high - low) : 1);
          return this.signed && !yCounts ? [low - margin, high + margin] : [0, high + margin];
        }},
      },
      axes: [axis(x, {size: 34, values: plain, ...(logX ? log125 : {})}),
        axis(y, {size: 52, values: plain, ...(log ? log125 : {})})],
      series: [{label: x}, ...series],
      hooks: hooks.list,
    };
  }

  draw() {
    for (const plot of this.plots) plot.destroy();
    const c = colours();
    this.plots = [this.drawScatter(c), this.drawHistogram(c)];
  }

  drawScatter(c) {
    const {set} = this;
    const covariate = set.covariates[this.against];
    const unit = this.kind === 'turned' ? 'deg' : 'mm';
    const at = spread(Array.from(covariate.values));
    const order = at.map((_, k) => k).sort((a, b) => at[a] - at[b]);
    const column = (values) => order.map((k) => (this.log && !(values[k] > 0) ? null : values[k]));
    const before = set.quantity('before', this.kind);
    const after = set.quantity('after', this.kind);
    let near = -1;
    const options = this.options(this.scatterAt, c, {
      x: covariate.name, y: `${this.signed ? `${this.kind} of the ` : ''}error [${unit}]`, log: this.log,
      series: [this.series('before', c.before, {paths: () => null}), this.series('after', c.after, {paths: () => null})],
      hooks: {list: {
        setCursor: [(u) => { near = this.read(u, order, covariate, unit); }],
        ready: [(u) => u.over.addEventListener('click', () => { if (near >= 0) this.chosen(near); })],
        draw: [(u) => this.drawFloor(u, c, 'y')],
      }},
    });
    this.scatterAt.replaceChildren();
    return new uPlot(options, [order.map((k) => at[k]), column(before), column(after)], this.scatterAt);
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

  /** Says what the dot nearest to the pointer is. \return its pose, or -1 */
  read(u, order, covariate, unit) {
    const {left, top} = u.cursor;
    let best = 24 ** 2;
    let found = -1;
    for (const s of left < 0 ? [] : [1, 2]) {
      if (!u.series[s].show) continue;
      for (let n = 0; n < order.length; ++n) {
        const y = u.data[s][n];
        if (y === null) continue;
        const d = (u.valToPos(u.data[0][n], 'x') - left) ** 2 + (u.valToPos(y, 'y') - top) ** 2;
        if (d < best) { best = d; found = order[n]; }
      }
    }
    if (found < 0) {
      this.hint();
      return -1;
    }
    const {set} = this;
    this.readout.replaceChildren(element('b', {}, `Pose ${set.number[found]}`),
      set.line.length > 0 ? ` (line ${set.line[found]})` : '',
      `: ${covariate.name} ${shown(covariate.values[found])}; before ${shown(set.quantity('before', this.kind)[found])} ${unit}, `
        + `after ${shown(set.quantity('after', this.kind)[found])} ${unit}`,
      set.outlier.has(found) ? '; lies far from the rest and does not count in full' : '');
    return found;
  }

  drawHistogram(c) {
    const before = this.set.quantity('before', this.kind);
    const after = this.set.quantity('after', this.kind);
    const log = this.log && !this.signed;
    const edges = classes(before, after, log);
    const steps = uPlot.paths.stepped({align: 1});
    const bars = (which, ink) => this.series(which, ink, {paths: steps, points: {show: false}, fill: `${ink}55`});
    const options = this.options(this.histogramAt, c, {
      x: this.kind === 'turned' ? 'orientation error [deg]' : `${this.signed ? `${this.kind} of the ` : ''}position error [mm]`,
      y: 'poses', log: false, logX: log, yCounts: true,
      series: [bars('before', c.before), bars('after', c.after)],
      hooks: {stepped: true, list: {draw: [(u) => this.drawFloor(u, c, 'x')]}},
    });
    this.histogramAt.replaceChildren();
    return new uPlot(options, [edges, counted(before, edges), counted(after, edges)], this.histogramAt);
  }

  resize() {
    [this.scatterAt, this.histogramAt].forEach((at, k) => {
      if (at.clientWidth > 0 && Math.abs(at.clientWidth - this.plots[k].width) > 1) this.plots[k].setSize({width: at.clientWidth, height});
    });
  }
}
