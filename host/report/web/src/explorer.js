// SPDX-License-Identifier: Apache-2.0
import {lengthText, roundDown, roundUp, shown} from './data.js';
import {check, choice, element, select, svgElement} from './elements.js';
import {PlotFrame} from './plot.js';

const height = 270;
const panelHeight = 170;  // of two histograms, one above the other
// One of two that are drawn over the same classes is a single bar where the other reaches this many times as far.
const apart = 8;
const reach = 24;  // of the pointer, pixels

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
    const kinds = [['size', 'length of the position error'], ['x', 'x'], ['y', 'y'], ['z', 'z']];
    if (set.turned) kinds.push(['turned', 'angle of the orientation error']);
    this.scatterAt = element('div', {class: 'chart scatter', role: 'group', tabindex: 0,
      onkeydown: (event) => this.key(event), onmousemove: (event) => this.point(event), onmouseleave: () => this.read(-1),
      onclick: () => this.take()});
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

  draw() {
    this.near = -1;
    const box = this.logBox.querySelector('input');
    box.disabled = !this.canBeLog;
    box.checked = this.isLog;
    this.drawScatter();
    this.drawHistograms();
    this.mark();
  }

  /** The axis of the errors, from one round number to another where it is logarithmic. */
  errorAxis(values) {
    if (this.isLog) {
      const positive = values.filter((v) => v > 0);
      const low = positive.length > 0 ? roundDown(least(positive)) : 0.1;
      return {low, high: positive.length > 0 ? Math.max(roundUp(most(positive)), 2 * low) : 1, log: true};
    }
    const [low, high] = [least(values), most(values)];
    const margin = high > low ? 0.06 * (high - low) : Math.max(Math.abs(high), 1e-6);
    return {low: this.signed ? low - margin : 0, high: high + margin};
  }

  drawScatter() {
    const {set, shown: drawn} = this;
    const covariate = set.covariates[this.against];
    this.at = spread(Array.from(covariate.values));
    this.order = this.at.map((_, k) => k).sort((a, b) => this.at[a] - this.at[b]);
    this.values = {before: set.quantity('before', this.kind), after: set.quantity('after', this.kind)};
    const all = drawn.flatMap((which) => Array.from(this.values[which]));
    const noughts = this.isLog ? all.filter((v) => !(v > 0)).length : 0;
    this.about.textContent = noughts > 0 ? `Errors of 0 (${noughts}) lie on the lower edge.` : '';
    const [low, high] = [least(this.at), most(this.at)];
    const margin = high > low ? 0.03 * (high - low) : 1;
    this.scatterAt.replaceChildren();
    this.scatter = new PlotFrame(this.scatterAt, {
      height, x: {name: covariate.name, low: low - margin, high: high + margin}, y: {name: this.name, ...this.errorAxis(all)},
    });
    this.drawFloor(this.scatter, 'y');
    const size = set.count > 400 ? 'mid' : 'dots';
    for (const which of drawn) {
      const places = this.at.map((_, pose) => this.place(which, pose));
      this.scatter.path(`${size} ${which}`, places.map(([x, y]) => `M${x} ${y}h0`).join(''));
      this.scatter.path('apart', [...set.outlier].map((pose) => places[pose])
        .map(([x, y]) => `M${x} ${y - 7}l7 7l-7 7l-7-7Z`).join(''));
    }
    this.rings = svgElement('g');
    this.scatter.svg.append(this.rings);
    const range = (which) => `${which} ${this.text(least(this.values[which]))} to ${this.text(most(this.values[which]))}`;
    this.scatterAt.setAttribute('aria-label', `${this.name} against ${covariate.name}, ${set.count} poses: ${
      drawn.map(range).join(', ')}. Arrow keys go from dot to dot.`);
  }

  /** Where the dot of a pose is, in pixels of the plot. */
  place(which, pose) {
    return [this.scatter.px(this.at[pose]), this.scatter.py(this.values[which][pose])];
  }

  /** The noise, where it can be seen: nothing can be below it for long. */
  drawFloor(frame, axis) {
    if (this.kind === 'size' && this.set.floor > 0) frame.noiseFloor(this.set.floor, axis);
  }

  /** Reads the dot nearest to the pointer. */
  point(event) {
    const [left, top] = this.scatter.place(event);
    let best = reach;
    let found = -1;
    for (const which of this.shown) {
      for (const pose of this.order) {
        const [x, y] = this.place(which, pose);
        const d = Math.hypot(x - left, y - top);
        if (d < best) { best = d; found = pose; }
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
      set.outlier.has(pose) ? '; outlier, down-weighted' : '');
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
    const ring = (kind, pose, r) => (pose < 0 ? [] : this.shown.map((which) => {
      const [cx, cy] = this.place(which, pose);
      return svgElement('circle', {class: `ring ${kind}`, cx, cy, r});
    }));
    this.rings.replaceChildren(...ring('chosen', this.pose, 9), ...ring('found', this.near, 7));
  }

  drawHistograms() {
    const {set, kind} = this;
    const log = this.isLog;
    const alone = (which) => set.histogram(kind, which, log);
    let parts = [alone(this.which)];
    if (this.which === 'both' && !log) {
      const [before, after] = ['before', 'after'].map(alone);
      const ratio = (before.high - before.low) / (after.high - after.low);
      if (ratio > apart || ratio < 1 / apart) parts = [before, after];
    }
    this.histogramAt.replaceChildren();
    this.histogramAt.setAttribute('aria-label', `Histogram of the ${this.name} of ${set.total} pose${set.total === 1 ? '' : 's'}: ${
      parts.flatMap((part) => Object.entries(part.counts).map(([which, counts]) => {
        const peak = counts.indexOf(most(counts));
        return `${which} most often from ${this.text(part.edges[peak])} to ${this.text(part.edges[peak + 1])}`;
      })).join(', ')}`);
    for (const {low, high, edges, counts} of parts) {
      const names = Object.keys(counts);
      const frame = new PlotFrame(this.histogramAt, {
        height: parts.length > 1 ? panelHeight : height,
        x: {name: parts.length > 1 ? `${names[0]}: ${this.name}` : this.name, low, high, log},
        y: {name: 'poses', low: 0, high: Math.max(1, 1.06 * most(names.flatMap((which) => counts[which]))), whole: true},
      });
      for (const which of names) {
        const steps = counts[which].map((n, k) => `V${frame.py(n)}H${frame.px(edges[k + 1])}`);
        frame.path(`bars ${which}`, `M${frame.px(low)} ${frame.py(0)}${steps.join('')}V${frame.py(0)}`);
      }
      this.drawFloor(frame, 'x');
    }
  }

  resize() {
    const {clientWidth} = this.scatterAt;
    if (clientWidth > 0 && clientWidth !== this.scatter.width) this.draw();
  }
}
