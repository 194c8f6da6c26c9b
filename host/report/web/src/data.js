// SPDX-License-Identifier: Apache-2.0
/**
 * The numbers of a page as web_data.cpp writes them, in the units that are drawn: rad for joints, m for places, mm for
 * errors, degrees for their angles.
 */

const scaled = (list, unit) => Float64Array.from(list ?? [], (v) => v * unit);

/** Joint readings of pose k, rad. */
export const jointsOf = (set, k) => set.q.subarray(6 * k, 6 * k + 6);

export const norm = (v) => Math.hypot(v[0], v[1], v[2]);

class PoseSet {
  constructor(json, units) {
    this.title = json.title;
    this.beforeIs = json.before_is;
    this.afterIs = json.after_is;
    this.total = json.total;  // poses of the data; of very many only some are here
    this.q = scaled(json.q, (units.joint_unit_deg * Math.PI) / 180);
    this.count = this.q.length / 6;
    this.before = scaled(json.before, json.before_unit_mm);
    this.after = scaled(json.after, json.after_unit_mm);
    this.turnedBefore = scaled(json.turned_before, json.before_unit_deg);
    this.turnedAfter = scaled(json.turned_after, json.after_unit_deg);
    this.histograms = json.histograms;
    this.floor = json.floor_mm;
    this.number = json.number ?? Array.from({length: this.count}, (_, k) => k + 1);
    this.line = json.line ?? (json.first_line === undefined ? [] : this.number.map((n) => json.first_line + n - 1));
    this.outlier = new Set(json.outlier);
    this.turn = json.turn;  // from the frame of the measurement to F0
    this.point = json.point ?? [0, 0, 0];  // measured, in Ftool
    this.covariates = [
      ...Array.from({length: 6}, (_, j) => ({
        name: `q${j + 1} [deg]`,
        values: Float64Array.from({length: this.count}, (_, k) => (this.q[6 * k + j] * 180) / Math.PI),
      })),
      ...json.covariates.map((c) => ({name: c.name, values: Float64Array.from(c.values)})),
      {name: 'order of the data', values: Float64Array.from(this.number)},
    ];
  }

  get turned() {
    return this.turnedBefore.length === this.count && this.count > 0;
  }

  /** Error vector of pose k, mm, in the frame of the measurement. */
  error(which, k) {
    return this[which].subarray(3 * k, 3 * k + 3);
  }

  /** The same in F0, where the arm is drawn. */
  errorInBase(which, k) {
    const e = this.error(which, k);
    return this.turn ? this.turn.map((row) => row[0] * e[0] + row[1] * e[1] + row[2] * e[2]) : [...e];
  }

  /** Whether a linear axis would press before or after onto zero. */
  startsLogarithmic(kind) {
    return this.histograms[kind].starts_log;
  }

  /**
   * How many of all poses, drawn or not, lie in which class: edges, one more than counts, and counts by name.
   * \return nothing where a logarithmic axis has nothing to show
   */
  histogram(kind, which, log) {
    const found = this.histograms[kind][log ? `${which}_log` : which];
    if (!found) return null;
    const {low, high, counts: [{length}]} = found;
    return {
      low, high,
      edges: Array.from({length: length + 1}, (_, k) =>
        (log ? low * (high / low) ** (k / length) : low + ((high - low) * k) / length)),
      counts: which === 'both' ? {before: found.counts[0], after: found.counts[1]} : {[which]: found.counts[0]},
    };
  }

  /** What is plotted of the errors: their size, a component, or the angle of the rotation error. */
  quantity(which, kind) {
    if (kind === 'turned') return which === 'before' ? this.turnedBefore : this.turnedAfter;
    const axis = 'xyz'.indexOf(kind);
    return Float64Array.from({length: this.count}, (_, k) => {
      const e = this.error(which, k);
      return axis < 0 ? norm(e) : e[axis];
    });
  }
}

/** A plan of poses: the same form as a measured set as far as an arm is drawn from it. */
class Plan {
  constructor(json, units) {
    const unit = (units.joint_unit_deg * Math.PI) / 180;
    this.q = scaled(json.q, unit);
    this.count = this.q.length / 6;
    this.known = {q: scaled(json.known, unit)};
    this.known.count = this.known.q.length / 6;
    this.payload = json.payload;
    this.tracker = json.tracker;  // in Fb, which is F0 to 20 mm
    this.obstacles = json.obstacles ?? [];
  }
}

export function readData(text) {
  const json = JSON.parse(text);
  return {
    arm: json.arm,
    sets: json.sets.map((set) => new PoseSet(set, json)),
    plan: json.plan && new Plan(json.plan, json),
  };
}

/** 1, 2 or 5 times a power of ten: the nearest from below. */
export function roundDown(v) {
  const power = 10 ** Math.floor(Math.log10(v) + 1e-9);
  const lead = v / power;
  return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
}

/** The same from above. */
export function roundUp(v) {
  const below = roundDown(v);
  return below >= v * (1 - 1e-9) ? below : roundDown(2.6 * below);
}

/** Three significant digits without an exponent, as the tables have it; never a nought for what is none. */
export function shown(v) {
  const size = Math.abs(v);
  if (!(size > 0)) return '0';
  if (size < 5e-6) return '< 0.00001';
  return v.toFixed(Math.min(Math.max(2 - Math.floor(Math.log10(size)), 0), 5));
}

/** A length with the unit in which it can be read. */
export function lengthText(mm) {
  const size = Math.abs(mm);
  if (size === 0 || size >= 1e-3) return `${shown(mm)} mm`;
  if (size >= 1e-6) return `${shown(mm * 1e3)} µm`;
  return size >= 1e-9 ? `${shown(mm * 1e6)} nm` : '< 0.001 nm';
}

/** A number on an axis: powers of ten where noughts would be many. */
export function tickText(v) {
  if (v === null) return '';
  const size = Math.abs(v);
  if (size === 0 || (size >= 1e-4 && size < 1e6)) return String(Number(v.toPrecision(6)));
  const [lead, power] = v.toExponential(5).split('e');
  const raised = [...String(Number(power))].map((c) => '⁰¹²³⁴⁵⁶⁷⁸⁹'['0123456789'.indexOf(c)] ?? '⁻').join('');
  return Number(lead) === 1 ? `10${raised}` : `${Number(lead)}·10${raised}`;
}
