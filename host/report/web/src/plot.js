// SPDX-License-Identifier: Apache-2.0
/**
 * The frame of a plot in SVG, in the classes of the page's style sheet: what plot_frame.cpp is to the plots that need no
 * script. One unit of the drawing is one pixel.
 */
import {roundUp, tickText} from './data.js';
import {svgElement} from './elements.js';

const margin = {top: 10, right: 16, bottom: 38};
const textWidth = (text) => 7 * text.length;  // of 12 px text, in the wider of the usual fonts

/** Maps low … high linearly or logarithmically to 0 … 1. */
const share = ({low, high, log}, v) => (log ? Math.log(Math.max(v, low) / low) / Math.log(high / low) : (v - low) / (high - low));

function linearTicks({low, high, whole}, about) {
  const step = Math.max(roundUp((high - low) / about), whole ? 1 : 0);
  const first = Math.ceil(low / step - 1e-6);
  const count = Math.max(Math.floor(high / step + 1e-6) - first + 1, 0);
  return Array.from({length: count}, (_, k) => (first + k) * step);
}

/** The ends, then powers of ten, then 2 and 5 times these. */
function logTicks({low, high}) {
  const ticks = [];
  for (let e = Math.floor(Math.log10(low) + 1e-9); 10 ** e <= high * 1.001; ++e) {
    for (const lead of [1, 2, 5]) ticks.push({v: Number(`${lead}e${e}`), rank: lead === 1 ? 1 : 2});
  }
  const inside = ticks.filter(({v}) => v >= low * 0.999 && v <= high * 1.001);
  if (inside.length > 0) inside[0].rank = inside[inside.length - 1].rank = 0;
  return inside.sort((a, b) => a.rank - b.rank || a.v - b.v).map(({v}) => v);
}

/** Ticks whose texts do not touch each other. */
function ticksOf(axis, length, across) {
  const touch = (v, w) => Math.abs(share(axis, v) - share(axis, w)) * length
    < (across ? (textWidth(tickText(v)) + textWidth(tickText(w))) / 2 + 8 : 14);
  if (axis.log) return logTicks(axis).reduce((kept, v) => (kept.some((w) => touch(v, w)) ? kept : [...kept, v]), []);
  for (let about = across ? 8 : 6; about > 1; --about) {
    const ticks = linearTicks(axis, about);
    if (ticks.every((v, k) => k === 0 || !touch(ticks[k - 1], v))) return ticks;
  }
  return linearTicks(axis, 1);
}

export class PlotFrame {
  /** @param {{name: string, low: number, high: number, log?: boolean, whole?: boolean}} x  and y: the axes */
  constructor(at, {height, x, y}) {
    const width = Math.max(at.clientWidth, 200);
    Object.assign(this, {width, x, y, base: height - margin.bottom, tall: height - margin.top - margin.bottom});
    const up = ticksOf(y, this.tall, false);
    this.left = 30 + Math.max(21, ...up.map((v) => textWidth(tickText(v))));
    this.wide = width - this.left - margin.right;
    const text = (kind, at_x, at_y, anchor, words, more = {}) =>
      svgElement('text', {class: kind, x: at_x, y: at_y, 'text-anchor': anchor, ...more}, words);
    this.svg = svgElement('svg', {viewBox: `0 0 ${width} ${height}`, 'aria-hidden': 'true'},
      svgElement('rect', {class: 'frame', x: this.left, y: margin.top, width: this.wide, height: this.tall}));
    const end = this.left + this.wide;
    for (const v of up) {
      this.path('grid', `M${this.left} ${this.py(v)}H${end}`);
      this.svg.append(text('tick', this.left - 5, this.py(v) + 4, 'end', tickText(v)));
    }
    for (const v of ticksOf(x, this.wide, true)) {
      this.path('grid', `M${this.px(v)} ${margin.top}V${this.base}`);
      this.path('axis', `M${this.px(v)} ${this.base}v4`);
      this.svg.append(text('tick', this.px(v), this.base + 16, 'middle', tickText(v)));
    }
    this.path('axis', `M${this.left} ${this.base}H${end}`);
    const middle = this.base - this.tall / 2;
    this.svg.append(text('name', this.left + this.wide / 2, height - 5, 'middle', x.name),
      text('name', 12, middle, 'middle', y.name, {transform: `rotate(-90 12 ${middle})`}));
    at.append(this.svg);
  }

  px(v) {
    return Number((this.left + share(this.x, v) * this.wide).toFixed(1));
  }

  py(v) {
    return Number((this.base - share(this.y, v) * this.tall).toFixed(1));
  }

  path(kind, d) {
    if (d) this.svg.append(svgElement('path', {class: kind, d}));
  }

  /** The noise as a line across the axis, where it lies on it. */
  noiseFloor(v, axis) {
    if (!(v >= this[axis].low && v <= this[axis].high)) return;
    const across = axis === 'y';
    const at = across ? this.py(v) : this.px(v);
    this.path('floor', across ? `M${this.left} ${at}h${this.wide}` : `M${at} ${margin.top}v${this.tall}`);
    this.svg.append(svgElement('text', across ? {class: 'tick', x: this.left + this.wide - 3, y: at - 4, 'text-anchor': 'end'}
      : {class: 'tick', x: at + 3, y: margin.top + 12}, 'noise'));
  }

  /** Where the pointer is, in units of the drawing. */
  place(event) {
    const box = this.svg.getBoundingClientRect();
    return [(event.clientX - box.left) * (this.width / box.width), (event.clientY - box.top) * (this.width / box.width)];
  }
}
