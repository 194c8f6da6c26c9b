// SPDX-License-Identifier: Apache-2.0
import {
  AmbientLight, BoxGeometry, BufferGeometry, CapsuleGeometry, CircleGeometry, Color, ConeGeometry, CylinderGeometry,
  DirectionalLight, DoubleSide, Float32BufferAttribute, Group, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  MeshLambertMaterial, PerspectiveCamera, Quaternion, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';
import {mergeGeometries} from 'three/addons/utils/BufferGeometryUtils.js';
import {chain, measuredPoint, placed, toolFrame} from './chain.js';
import {colours, onColours, onPaper} from './colours.js';
import {jointsOf, lengthText, norm, roundDown} from './data.js';
import {check, choice, element, select} from './elements.js';

const up = new Vector3(0, 1, 0);  // what three's cylinders stand along
const vector = (p) => new Vector3(p[0], p[1], p[2]);

/** Brings a body that stands on +y from 0 to 1 from one place to another. */
function between(from, to, thickness) {
  const along = to.clone().sub(from);
  const length = along.length();
  const turn = new Quaternion().setFromUnitVectors(up, length > 0 ? along.divideScalar(length) : up);
  return new Matrix4().compose(from, turn, new Vector3(thickness, Math.max(length, 1e-9), thickness));
}

/** An arrow from 0 to 1 on +y, its shaft one thick. */
function arrowGeometry(corners) {
  const shaft = new CylinderGeometry(0.5, 0.5, 0.7, corners, 1, true).translate(0, 0.35, 0);
  const tip = new ConeGeometry(1.5, 0.3, corners).translate(0, 0.85, 0);
  return mergeGeometries([shaft, tip]);
}

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
    const factor = this.lengths[this.length];
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

  material(ink, opacity = 1) {
    return new MeshLambertMaterial({color: new Color(ink), transparent: opacity < 1, opacity, depthWrite: opacity === 1});
  }

  /** Everything anew: a few dozen bodies and some instanced meshes. */
  build() {
    if (this.content) {
      this.scene.remove(this.content);
      this.content.traverse((o) => { o.geometry?.dispose(); o.material?.dispose(); });
    }
    this.content = new Group();
    this.scene.add(this.content);
    const {set, plan} = this.now;
    this.addGround();
    this.addArm(jointsOf(set, this.pose));
    if (plan) this.addPlan();
    else this.addErrors();
    this.describe();
  }

  addGround() {
    const c = this.colours;
    const fixed = this.arm.capsules.filter((b) => b.frame === 0);
    const floor = Math.min(0, ...fixed.flatMap((b) => [b.from[2], b.to[2]]));
    this.square = roundDown(this.size / 4);
    const half = Math.ceil((1.1 * this.size) / this.square);
    const lines = [];
    for (let k = -half; k <= half; ++k) {
      const at = k * this.square;
      const end = half * this.square;
      lines.push(at, -end, floor, at, end, floor, -end, at, floor, end, at, floor);
    }
    this.addLines(lines, c.grid, 1);
    const axis = 0.2 * this.size;
    for (const [ink, to] of [[c.x, [axis, 0, 0]], [c.y, [0, axis, 0]], [c.z, [0, 0, axis]]]) {
      this.addBody(arrowGeometry(8), this.material(ink), between(new Vector3(), vector(to), 0.009 * this.size));
    }
  }

  addLines(coordinates, ink, opacity) {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute(coordinates, 3));
    this.content.add(new LineSegments(geometry, new LineBasicMaterial({color: new Color(ink), transparent: opacity < 1, opacity})));
  }

  addBody(geometry, material, matrix) {
    const mesh = new Mesh(geometry, material);
    mesh.matrixAutoUpdate = false;
    mesh.matrix.copy(matrix);
    this.content.add(mesh);
    return mesh;
  }

  addRod(from, to, thickness, material) {
    if (from.distanceTo(to) < 1e-6) return;
    this.addBody(new CylinderGeometry(0.5, 0.5, 1, 16).translate(0, 0.5, 0), material, between(from, to, thickness));
  }

  addBall(at, radius, material) {
    this.addBody(new SphereGeometry(radius, 20, 14), material, new Matrix4().setPosition(at));
  }

  /** Links along z and x of their frames, joints about their axes, tool and reflectors; bodies as glass around them. */
  addArm(q) {
    const c = this.colours;
    const thick = 0.035 * this.size;
    const frames = chain(this.arm, q);
    const link = this.material(c.axis);
    const joint = this.material(c.soft);
    for (let i = 1; i < frames.length; ++i) {
      const from = vector(frames[i - 1].origin);
      const elbow = vector(frames[i].elbow);
      this.addRod(from, elbow, thick, link);
      this.addRod(elbow, vector(frames[i].origin), thick, link);
      this.addBall(elbow, 0.5 * thick, link);
      const axis = vector(frames[i - 1].z).multiplyScalar(0.9 * thick);
      this.addRod(from.clone().sub(axis), from.clone().add(axis), 1.5 * thick, joint);
    }
    const flange = vector(frames[6].origin);
    this.addBall(flange, 0.6 * thick, link);
    const tool = toolFrame(this.arm, frames[6]);
    const plain = this.material(c.ink);
    const tip = vector(placed(tool, this.now.set.point ?? [0, 0, 0]));
    this.addRod(flange, vector(tool.origin), 0.3 * thick, plain);
    this.addRod(vector(tool.origin), tip, 0.3 * thick, plain);
    for (const p of this.arm.reflectors) {
      const at = vector(placed(tool, p));
      this.addRod(vector(tool.origin), at, 0.25 * thick, plain);
      this.addBall(at, 0.35 * thick, plain);
    }
    this.addBall(tip, 0.35 * thick, plain);
    if (!this.shown.bodies) return;
    const glass = this.material(c.axis, 0.22);
    for (const body of this.arm.capsules) this.addCapsule(body, frames[body.frame], glass);
  }

  addCapsule(body, frame, material) {
    const from = vector(frame ? placed(frame, body.from) : body.from);
    const to = vector(frame ? placed(frame, body.to) : body.to);
    if (body.radius > 4 * this.size) {
      this.addSurface(from, to, body.radius, material);
      return;
    }
    const length = from.distanceTo(to);
    const turn = new Quaternion().setFromUnitVectors(up, length > 0 ? to.clone().sub(from).divideScalar(length) : up);
    this.addBody(new CapsuleGeometry(body.radius, length, 8, 24), material,
      new Matrix4().compose(from.clone().add(to).multiplyScalar(0.5), turn, new Vector3(1, 1, 1)));
  }

  /** A floor or wall is a capsule so thick that it is flat: what of it is near the arm. */
  addSurface(from, to, radius, material) {
    const along = to.clone().sub(from);
    const t = along.lengthSq() > 0 ? Math.min(Math.max(-from.dot(along) / along.lengthSq(), 0), 1) : 0;
    const axis = from.clone().addScaledVector(along, t);
    const normal = axis.clone().negate().normalize();
    const at = axis.addScaledVector(normal, radius);
    const flat = material.clone();
    flat.side = DoubleSide;
    this.addBody(new CircleGeometry(1.6 * this.size, 48), flat, new Matrix4().compose(at,
      new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), normal), new Vector3(1, 1, 1)));
  }

  addErrors() {
    const {set} = this.now;
    const c = this.colours;
    const many = set.count > 500;
    const factor = this.lengths[this.length] * 1e-3;
    const thick = (many ? 0.0025 : 0.006) * this.size;
    const dots = new InstancedMesh(new SphereGeometry(0.8 * thick, many ? 5 : 10, many ? 4 : 8), this.material(c.soft), set.count);
    const matrix = new Matrix4();
    this.points.forEach((p, k) => dots.setMatrixAt(k, matrix.makeTranslation(p.x, p.y, p.z)));
    this.content.add(dots);
    if (set.outlier.size > 0) {
      const odd = this.material(c.ink);
      for (const k of set.outlier) this.addBall(this.points[k], 0.009 * this.size, odd);
    }
    for (const which of ['before', 'after']) {
      if (this.shown.errors !== 'both' && this.shown.errors !== which) continue;
      const material = this.material(c[which]);
      material.emissive.set(c[which]);  // as the legend has it, also where no light falls
      material.emissiveIntensity = 0.5;
      const arrows = new InstancedMesh(arrowGeometry(many ? 4 : 8), material, set.count);
      this.points.forEach((p, k) => {
        const to = vector(set.errorInBase(which, k)).multiplyScalar(factor);
        // A short arrow is a thin one, or it would be a disc.
        arrows.setMatrixAt(k, between(p, to.clone().add(p), Math.min(thick, 0.25 * to.length())));
      });
      this.content.add(arrows);
    }
  }

  addPlan() {
    const plan = this.now.set;
    const c = this.colours;
    const skeleton = (poses) => {
      const lines = [];
      for (let k = 0; k < poses.count; ++k) {
        const frames = chain(this.arm, jointsOf(poses, k));
        const stops = frames.flatMap((f) => (f.elbow ? [f.elbow, f.origin] : [f.origin]));
        stops.push(toolFrame(this.arm, frames[6]).origin);
        for (let s = 1; s < stops.length; ++s) lines.push(...stops[s - 1], ...stops[s]);
      }
      return lines;
    };
    const reflectors = (k) => {
      const tool = toolFrame(this.arm, chain(this.arm, jointsOf(plan, k))[6]);
      return this.arm.reflectors.length > 0 ? this.arm.reflectors.map((p) => placed(tool, p)) : [tool.origin];
    };
    if (this.shown.poses) {
      this.addLines(skeleton(plan), c.after, 0.45);
      if (plan.known.count > 0) this.addLines(skeleton(plan.known), c.before, 0.35);
      const dots = this.material(c.after);
      for (const p of this.points) this.addBall(p, 0.012 * this.size, dots);
      const before = this.material(c.before);
      for (const p of this.known) this.addBall(p, 0.009 * this.size, before);
    }
    if (this.shown.bodies) {
      const glass = this.material(c.soft, 0.3);
      for (const body of plan.obstacles) this.addCapsule(body, null, glass);
    }
    if (!plan.tracker) return;
    const tracker = vector(plan.tracker);
    const head = 0.05 * this.size;
    this.addBody(new BoxGeometry(1.2 * head, 1.2 * head, 2 * head), this.material(c.soft),
      new Matrix4().setPosition(tracker.clone().setZ(tracker.z - 1.2 * head)));
    this.addBall(tracker, 0.5 * head, this.material(c.y));
    const beams = this.material(c.y);
    for (const p of reflectors(this.pose)) this.addRod(tracker, vector(p), 0.006 * this.size, beams);
    if (!this.shown.poses) return;
    const faint = [];
    for (let k = 0; k < plan.count; ++k) for (const p of reflectors(k)) faint.push(...plan.tracker, ...p);
    this.addLines(faint, c.y, 0.25);
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
    const squares = `One square of the grid: ${mm(this.square)} of the arm`;
    if (plan) {
      this.words.textContent = `${squares}. The arm with its bodies stands in the pose chosen below; the others are lines.`;
    } else {
      const factor = this.lengths[this.length];
      const times = this.timesText();
      this.lengthSlider.setAttribute('aria-valuetext', times);
      this.words.textContent = `Errors are drawn ${factor === 1 ? 'as long' : `${times} as long`} as they are. ${squares}, `
        + `${mm(this.square / factor)} of error. ${this.tooShort()}The arm is the nominal one.`
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
      } else if (this.usual(which) * this.lengths[this.length] < 0.01 * this.size) {
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
    if (turns) this.turn(...turns);
    else if (event.key === '+' || event.key === '=') this.approach(0.8);
    else if (event.key === '-') this.approach(1.25);
    else return;
    event.preventDefault();
  }

  /** Around the upright axis, and up or down, rad. */
  turn(around, down) {
    const from = this.camera.position.clone().sub(this.controls.target);
    const distance = from.length();
    const angle = Math.atan2(from.y, from.x) + around;
    const steep = Math.min(Math.max(Math.acos(from.z / distance) + down, 0.02), Math.PI - 0.02);
    this.camera.position.set(Math.sin(steep) * Math.cos(angle), Math.sin(steep) * Math.sin(angle), Math.cos(steep))
      .multiplyScalar(distance).add(this.controls.target);
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

  /** Turns the view and comes as near as still shows all points, the arm, and the instrument. */
  lookFrom(from) {
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
      const factor = this.lengths[this.length] * 1e-3;
      // One that is far longer than the others may leave the picture, or nothing else were seen.
      this.points.forEach((p, k) => places.push(
        vector(set.errorInBase(which, k)).multiplyScalar(factor).clampLength(0, 0.6 * this.size).add(p)));
    }
    for (let k = 0; k < (plan ? set.known.count : 0); ++k) {
      places.push(...chain(this.arm, jointsOf(set.known, k)).map((f) => vector(f.origin)));
    }
    const towards = vector(from).normalize();
    this.camera.position.copy(towards);
    this.camera.lookAt(0, 0, 0);
    this.camera.updateMatrixWorld();
    const [right, above] = [0, 1].map((k) => new Vector3().setFromMatrixColumn(this.camera.matrixWorld, k));
    const tall = 0.92 * Math.tan((this.camera.fov * Math.PI) / 360);
    const wide = tall * this.camera.aspect;
    // Each place must lie inside the pyramid of the view: middle and distance follow from the outermost ones, first
    // without perspective.
    const extent = (axis) => {
      const at = places.map((p) => p.dot(axis));
      return [at.reduce((x, y) => Math.min(x, y)), at.reduce((x, y) => Math.max(x, y))];
    };
    const middle = new Vector3();
    for (const axis of [right, above, towards]) middle.addScaledVector(axis, extent(axis).reduce((x, y) => x + y) / 2);
    let distance = 0.3 * this.size;
    for (const p of places) {
      const at = p.clone().sub(middle);
      const depth = at.dot(towards) + 0.08 * this.size;
      distance = Math.max(distance, depth + Math.abs(at.dot(right)) / wide, depth + Math.abs(at.dot(above)) / tall);
    }
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(towards, distance);
    this.camera.near = distance / 100;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
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
