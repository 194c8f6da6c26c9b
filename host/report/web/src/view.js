// SPDX-License-Identifier: Apache-2.0
import {AmbientLight, DirectionalLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer} from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';
import {fitCamera, turnCamera} from './camera.js';
import {chain, measuredPoint, placed} from './chain.js';
import {colours, onColours, onPaper} from './colours.js';
import {jointsOf, lengthText, norm, roundDown} from './data.js';
import {check, choice, element, select} from './elements.js';
import {SceneContent, vector} from './scene.js';

/** How many times as long an error of the usual size is well seen. */
const lengthening = (usual, size) => Math.max(roundDown((0.2 * size) / usual), 1);

/** 1, 2, 5, 10 … from one to the other. */
function steps(from, to) {
  const list = [];
  for (let e = Math.floor(Math.log10(from)); 10 ** e <= to; ++e) list.push(...[1, 2, 5].map((lead) => lead * 10 ** e));
  return list.filter((v) => v >= from * 0.999 && v <= to * 1.001);
}

/** The arm in 3-D: error vectors before and after, or a plan with its beams and bodies. */
export class ArmView {
  /** @param {(number: number, pose: number) => void} stands  told in which pose of which set the arm stands */
  constructor(at, data, stands) {
    this.data = data;
    this.stands = stands;
    this.arm = data.arm;
    // Shown one at a time.
    this.scenes = [
      ...(data.plan && data.plan.count > 0 ? [{plan: true, set: data.plan, number: -1}] : []),
      ...data.sets.map((set, number) => ({plan: false, set, number})).filter((s) => s.set.count > 0),
    ];
    if (this.scenes.length === 0) return;
    this.shown = {errors: 'both', bodies: true, poses: true};
    this.renderer = new WebGLRenderer({antialias: true, alpha: true, preserveDrawingBuffer: true});
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(35, 4 / 3, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.ambient = new AmbientLight(0xffffff, 1.6);
    this.sun = new DirectionalLight(0xffffff, 1.8);
    this.scene.add(this.ambient, this.sun, this.sun.target);
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'application');  // its keys are its own
    canvas.setAttribute('aria-roledescription', 'picture that can be turned');
    // Printed instead: what WebGL draws after a page was told that it is printed does not reach the paper.
    this.copy = element('canvas', {class: 'copy', 'aria-hidden': 'true'});
    this.stage = element('div', {class: 'stage'}, canvas, this.copy);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.render());
    // A finger that moves up or down scrolls the page; a wheel does until the view was clicked.
    canvas.style.touchAction = 'pan-y pinch-zoom';
    this.controls.enableZoom = false;
    canvas.addEventListener('focus', () => { this.controls.enableZoom = true; });
    canvas.addEventListener('blur', () => { this.controls.enableZoom = false; });
    canvas.addEventListener('pointerdown', (event) => { this.pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener('click', (event) => this.pick(event));
    canvas.addEventListener('keydown', (event) => this.key(event));
    // A driver may take everything back that was drawn; three makes it anew when it is asked to.
    canvas.addEventListener('webglcontextrestored', () => {
      this.build();
      this.renderNow();
    });
    this.panel = element('div', {class: 'controls'});
    this.legend = element('ul', {class: 'legend'});
    this.words = element('p', {class: 'note scale'});
    this.readout = element('p', {class: 'note readout', role: 'status'});
    at.replaceChildren(this.stage, this.legend, this.words, this.readout, this.panel);
    this.colours = colours();
    this.enter(this.scenes[0]);
    new ResizeObserver(() => this.resize()).observe(this.stage);
    onColours(() => {
      this.colours = colours();
      this.build();
      this.renderNow();
      if (onPaper()) this.copyPicture();
    });
    this.resize();
  }

  enter(entered) {
    this.now = entered;
    this.pose = 0;
    const {set} = entered;
    this.points = Array.from({length: set.count}, (_, k) => vector(measuredPoint(this.arm, jointsOf(set, k), set.point)));
    const home = chain(this.arm, new Array(6).fill(0)).map((f) => norm(f.origin));
    // What a plan does not need to measure again.
    this.known = Array.from({length: set.known?.count ?? 0}, (_, k) => vector(measuredPoint(this.arm, jointsOf(set.known, k))));
    this.size = Math.max(...home, ...this.points.map((p) => p.length()), 0.1);
    if (!entered.plan) {
      // What is left is far shorter: alone it is drawn longer.
      const usual = ['before', 'after'].map((which) => this.usual(which));
      const [before, after] = usual.map((v) => lengthening(v > 0 ? v : Math.max(...usual) || this.size, this.size));
      // Together both must have room.
      this.fitting = {before, after, both: Math.min(before, after)};
      const low = Math.min(this.fitting.before, this.fitting.after) / 20;
      this.lengths = steps(Math.max(low, 1), Math.max(this.fitting.before, this.fitting.after) * 20);
      this.fitLength();
    }
    this.fillPanel();
    this.build();
    this.lookFrom([0.75, -1.1, 0.55]);
    this.tell();
  }

  /** Says in which pose the arm stands. */
  tell() {
    this.stands(this.now.number, this.pose);
  }

  /** "200 times", for the slider and the words. */
  timesText() {
    const {factor} = this;
    return factor === 1 ? 'as they are' : `${factor.toLocaleString('en')} times`;
  }

  /** Four of five errors are shorter, m. */
  usual(which) {
    const {set} = this.now;
    const sizes = Array.from({length: set.count}, (_, k) => norm(set.error(which, k)) * 1e-3).sort((a, b) => a - b);
    return sizes[Math.floor(sizes.length * 0.8)] ?? 0;
  }

  fitLength() {
    const wanted = this.fitting[this.shown.errors];
    this.length = Math.max(this.lengths.findIndex((v) => v >= wanted * 0.999), 0);
    if (this.lengthSlider) this.lengthSlider.value = this.length;
  }

  fillPanel() {
    const {set, plan} = this.now;
    const pose = element('input', {type: 'range', min: 1, max: set.count, value: this.pose + 1,
      oninput: (event) => this.choosePose(Number(event.target.value) - 1)});
    this.poseSlider = pose;
    const step = (by, text, label) => element('button', {type: 'button', 'aria-label': label,
      onclick: () => this.choosePose((this.pose + by + set.count) % set.count)}, text);
    const look = (from, text) => element('button', {type: 'button', onclick: () => this.lookFrom(from)}, text);
    const redraw = (key) => (value) => {
      this.shown[key] = value;
      this.build();
      this.render();
    };
    const titles = this.scenes.map((s, k) => [String(k), s.plan ? 'the plan' : s.set.title]);
    const parts = [];
    if (titles.length > 1) {
      parts.push(select('show', titles, String(this.scenes.indexOf(this.now)), (k) => this.enter(this.scenes[Number(k)])));
    }
    if (!plan) {
      this.lengthSlider = element('input', {
        type: 'range', class: 'length', min: 0, max: this.lengths.length - 1, value: this.length,
        'aria-valuetext': this.timesText(),
        oninput: (event) => { this.length = Number(event.target.value); this.build(); this.render(); },
      });
      parts.push(
        choice('errors', [['before', 'before'], ['both', 'both'], ['after', 'after']], this.shown.errors, (which) => {
          this.shown.errors = which;
          this.fitLength();
          this.build();
          this.render();
        }),
        element('label', {class: 'field'}, element('span', {}, 'how long errors are drawn'), this.lengthSlider));
    }
    parts.push(
      element('label', {class: 'field'}, element('span', {}, 'pose in which the arm stands'), pose),
      element('span', {class: 'buttons'}, step(-1, '◀', 'the pose before'), step(1, '▶', 'the next pose')),
      element('span', {class: 'buttons'}, look([0.75, -1.1, 0.55], 'aslant'), look([1, 0, 0.12], 'front'),
        look([0, -1, 0.12], 'side'), look([0.001, 0, 1], 'above'),
        element('button', {type: 'button', 'aria-label': 'nearer', onclick: () => this.approach(0.8)}, '+'),
        element('button', {type: 'button', 'aria-label': 'farther', onclick: () => this.approach(1.25)}, '−')));
    if (this.arm.capsules.length > 0 || (plan && set.obstacles.length > 0)) {
      parts.push(check('bodies (capsules)', this.shown.bodies, redraw('bodies')));
    }
    if (plan) parts.push(check('all poses', this.shown.poses, redraw('poses')));
    this.panel.replaceChildren(...parts);
  }

  /** Goes to a pose of a set from elsewhere on the page. */
  choose(number, pose) {
    const wanted = this.scenes.find((s) => s.number === number);
    if (!wanted) return;
    if (wanted !== this.now) this.enter(wanted);
    this.choosePose(pose);
    this.stage.scrollIntoView({block: 'nearest', behavior: 'smooth'});
  }

  choosePose(pose) {
    this.pose = Math.min(Math.max(pose, 0), this.now.set.count - 1);
    this.poseSlider.value = this.pose + 1;
    this.build();
    this.render();
    this.tell();
  }

  /** Everything anew. */
  build() {
    if (this.content) {
      this.scene.remove(this.content);
      this.content.dispose();
    }
    this.content = new SceneContent(this);
    this.scene.add(this.content);
    this.describe();
  }

  /** How many times as long as they are errors are drawn. */
  get factor() {
    return this.lengths?.[this.length];
  }

  describe() {
    const {set, plan} = this.now;
    const item = (mark, text) => element('li', {}, element('span', {class: `mark ${mark}`}), ` ${text}`);
    const mm = (metres) => lengthText(metres * 1e3);
    const list = [];
    if (plan) {
      list.push(item('after', 'planned poses'));
      if (set.known.count > 0) list.push(item('known', 'measured already'));
      if (set.tracker) list.push(item('beam', 'beams from the instrument to the reflectors'));
    } else {
      if (this.shown.errors !== 'after') list.push(item('before', `error before: ${set.beforeIs}`));
      if (this.shown.errors !== 'before') list.push(item('after', `error after: ${set.afterIs}`));
      if (set.outlier.size > 0) list.push(item('plain', 'lies far from the rest'));
    }
    if (this.shown.bodies && (this.arm.capsules.length > 0 || (plan && set.obstacles.length > 0))) {
      list.push(item('body', 'glass: bodies that must not touch or stand in a beam'));
    }
    list.push(element('li', {}, 'axes of the base: ', element('span', {class: 'mark x'}), ' x ',
      element('span', {class: 'mark y'}), ' y ', element('span', {class: 'mark z'}), ' z'));
    this.legend.replaceChildren(...list);
    const squares = `One square of the grid: ${mm(this.content.square)} of the arm`;
    if (plan) {
      this.words.textContent = `${squares}. The arm with its bodies stands in the pose chosen below; the others are lines.`;
    } else {
      const {factor} = this;
      const times = this.timesText();
      this.lengthSlider.setAttribute('aria-valuetext', times);
      this.words.textContent = `Errors are drawn ${factor === 1 ? 'as long' : `${times} as long`} as they are. ${squares}, `
        + `${mm(this.content.square / factor)} of error. ${this.tooShort()}The arm is the nominal one.`
        + (set.count < set.total ? ` ${set.count} of ${set.total} poses are drawn.` : '');
    }
    this.poseSlider.setAttribute('aria-valuetext', `pose ${plan ? this.pose + 1 : set.number[this.pose]}`);
    const q = Array.from(jointsOf(set, this.pose), (v, j) => `q${j + 1} ${(Math.round((v * 1800) / Math.PI) / 10 + 0).toFixed(1)}°`).join(', ');
    const said = [element('b', {}, `Pose ${plan ? this.pose + 1 : set.number[this.pose]}`), ` of ${plan ? set.count : set.total}`];
    if (plan) {
      if (set.payload.length > 0) said.push(`, with ${set.payload[this.pose]} kg`);
    } else {
      if (set.line.length > 0) said.push(` (line ${set.line[this.pose]})`);
      said.push(`: ${lengthText(norm(set.error('before', this.pose)))} before, ${lengthText(norm(set.error('after', this.pose)))} after`);
    }
    this.readout.replaceChildren(...said, `; ${q}`);
    this.renderer.domElement.setAttribute('aria-label', plan
      ? `The arm in pose ${this.pose + 1} of ${set.count} of the plan, with bodies and beams`
      : `The arm with the position errors of ${set.count} pose${set.count === 1 ? '' : 's'} as arrows. ${this.words.textContent} `
        + 'Arrow keys turn it, + and − come nearer and go farther.');
  }

  /** A sentence on errors that are shown and yet cannot be seen. */
  tooShort() {
    const {set} = this.now;
    const words = [];
    for (const which of ['before', 'after']) {
      if (this.shown.errors !== 'both' && this.shown.errors !== which) continue;
      if (!set[which].some((v) => v !== 0)) {
        words.push(`There are no errors ${which}. `);
      } else if (this.usual(which) * this.factor < 0.01 * this.size) {
        words.push(`The errors ${which} are too short to be seen at this length`
          + `${onPaper() || this.shown.errors === which ? '' : `: choose “${which}”`}. `);
      }
    }
    return words.join('');
  }

  key(event) {
    const step = Math.PI / 18;
    const turns = {ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step]}[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (turns) this.turn(turns);
    else if (event.key === '+' || event.key === '=') this.approach(0.8);
    else if (event.key === '-') this.approach(1.25);
    else return;
    event.preventDefault();
  }

  turn(by) {
    turnCamera(this.camera, this.controls.target, ...by);
    this.controls.update();
    this.render();
  }

  /** A click, not the end of a turn: the nearest measured point. */
  pick(event) {
    if (!this.pressed || Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]) > 4) return;
    const box = this.renderer.domElement.getBoundingClientRect();
    let best = 14;
    let found = -1;
    this.points.forEach((p, k) => {
      const at = p.clone().project(this.camera);
      const d = Math.hypot(box.left + (0.5 + 0.5 * at.x) * box.width - event.clientX,
        box.top + (0.5 - 0.5 * at.y) * box.height - event.clientY);
      if (d < best) { best = d; found = k; }
    });
    if (found >= 0) this.choosePose(found);
  }

  /** What the picture must show: all points, the arm, its bodies and errors, and the instrument. */
  placesToShow() {
    const {set, plan} = this.now;
    const frames = chain(this.arm, jointsOf(set, this.pose));
    const places = [new Vector3(), ...this.points, ...this.known, ...frames.map((f) => vector(f.origin)),
      ...[[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => vector(axis).multiplyScalar(0.2 * this.size))];
    if (plan && set.tracker) places.push(vector(set.tracker));
    if (this.shown.bodies) {
      for (const body of this.arm.capsules.filter((c) => c.radius <= 0.5 * this.size)) {
        for (const end of [body.from, body.to]) {
          const at = vector(placed(frames[body.frame] ?? frames[0], end));
          for (const d of [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]) {
            places.push(vector(d).multiplyScalar(body.radius).add(at));
          }
        }
      }
    }
    for (const which of plan ? [] : ['before', 'after']) {
      if (this.shown.errors !== 'both' && this.shown.errors !== which) continue;
      const factor = this.factor * 1e-3;
      // One that is far longer than the others may leave the picture, or nothing else were seen.
      this.points.forEach((p, k) => places.push(
        vector(set.errorInBase(which, k)).multiplyScalar(factor).clampLength(0, 0.6 * this.size).add(p)));
    }
    for (let k = 0; k < (plan ? set.known.count : 0); ++k) {
      places.push(...chain(this.arm, jointsOf(set.known, k)).map((f) => vector(f.origin)));
    }
    return places;
  }

  /** Turns the view and comes as near as still shows all of that. */
  lookFrom(from) {
    this.controls.target.copy(fitCamera(this.camera, from, this.placesToShow(), this.size));
    this.from = from;
    this.controls.update();
    this.render();
  }

  approach(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.render();
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.stage;
    if (!(width > 0 && height > 0)) return;
    const first = this.wide === undefined;
    this.wide = width;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (first) this.lookFrom(this.from);
    this.renderNow();
  }

  copyPicture() {
    const {domElement: from} = this.renderer;
    this.copy.width = from.width;
    this.copy.height = from.height;
    this.copy.getContext('2d').drawImage(from, 0, 0);
  }

  render() {
    this.asked ??= requestAnimationFrame(() => this.renderNow());
  }

  renderNow() {
    if (this.asked !== undefined) cancelAnimationFrame(this.asked);
    this.asked = undefined;
    this.sun.position.copy(this.camera.position);
    this.sun.target.position.copy(this.controls.target);
    this.renderer.render(this.scene, this.camera);
  }
}
