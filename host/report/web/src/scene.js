// SPDX-License-Identifier: Apache-2.0
import {
  BoxGeometry, BufferGeometry, CapsuleGeometry, CircleGeometry, Color, ConeGeometry, CylinderGeometry, DoubleSide,
  Float32BufferAttribute, Group, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshLambertMaterial, Quaternion,
  SphereGeometry, Vector3,
} from 'three';
import {mergeGeometries} from 'three/addons/utils/BufferGeometryUtils.js';
import {chain, placed, toolFrame} from './chain.js';
import {jointsOf, roundDown} from './data.js';

const up = new Vector3(0, 1, 0);  // what three's cylinders stand along
export const vector = (p) => new Vector3(p[0], p[1], p[2]);

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

const matte = (ink, opacity = 1) =>
  new MeshLambertMaterial({color: new Color(ink), transparent: opacity < 1, opacity, depthWrite: opacity === 1});

/** All bodies of the picture: a few dozen and some instanced meshes. */
export class SceneContent extends Group {
  /** @param view  arm, set or plan (`now`), pose, points, what is shown, size, factor of the errors, colours */
  constructor({arm, now, pose, points, known, shown, size, factor, colours}) {
    super();
    Object.assign(this, {arm, now, pose, points, known, shown, size, factor, colours});
    this.addGround();
    this.addArm(jointsOf(now.set, pose));
    if (now.plan) this.addPlan();
    else this.addErrors();
  }

  dispose() {
    this.traverse((o) => { o.geometry?.dispose(); o.material?.dispose(); });
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
      this.addBody(arrowGeometry(8), matte(ink), between(new Vector3(), vector(to), 0.009 * this.size));
    }
  }

  addLines(coordinates, ink, opacity) {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute(coordinates, 3));
    this.add(new LineSegments(geometry, new LineBasicMaterial({color: new Color(ink), transparent: opacity < 1, opacity})));
  }

  addBody(geometry, material, matrix) {
    const mesh = new Mesh(geometry, material);
    mesh.matrixAutoUpdate = false;
    mesh.matrix.copy(matrix);
    this.add(mesh);
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
    const link = matte(c.axis);
    const joint = matte(c.soft);
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
    const plain = matte(c.ink);
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
    const glass = matte(c.axis, 0.22);
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
    const factor = this.factor * 1e-3;
    const thick = (many ? 0.0025 : 0.006) * this.size;
    const dots = new InstancedMesh(new SphereGeometry(0.8 * thick, many ? 5 : 10, many ? 4 : 8), matte(c.soft), set.count);
    const matrix = new Matrix4();
    this.points.forEach((p, k) => dots.setMatrixAt(k, matrix.makeTranslation(p.x, p.y, p.z)));
    this.add(dots);
    if (set.outlier.size > 0) {
      const odd = matte(c.ink);
      for (const k of set.outlier) this.addBall(this.points[k], 0.009 * this.size, odd);
    }
    for (const which of ['before', 'after']) {
      if (this.shown.errors !== 'both' && this.shown.errors !== which) continue;
      const material = matte(c[which]);
      material.emissive.set(c[which]);  // as the legend has it, also where no light falls
      material.emissiveIntensity = 0.5;
      const arrows = new InstancedMesh(arrowGeometry(many ? 4 : 8), material, set.count);
      this.points.forEach((p, k) => {
        const to = vector(set.errorInBase(which, k)).multiplyScalar(factor);
        // A short arrow is a thin one, or it would be a disc.
        arrows.setMatrixAt(k, between(p, to.clone().add(p), Math.min(thick, 0.25 * to.length())));
      });
      this.add(arrows);
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
      const dots = matte(c.after);
      for (const p of this.points) this.addBall(p, 0.012 * this.size, dots);
      const before = matte(c.before);
      for (const p of this.known) this.addBall(p, 0.009 * this.size, before);
    }
    if (this.shown.bodies) {
      const glass = matte(c.soft, 0.3);
      for (const body of plan.obstacles) this.addCapsule(body, null, glass);
    }
    if (!plan.tracker) return;
    const tracker = vector(plan.tracker);
    const head = 0.05 * this.size;
    this.addBody(new BoxGeometry(1.2 * head, 1.2 * head, 2 * head), matte(c.soft),
      new Matrix4().setPosition(tracker.clone().setZ(tracker.z - 1.2 * head)));
    this.addBall(tracker, 0.5 * head, matte(c.y));
    const beams = matte(c.y);
    for (const p of reflectors(this.pose)) this.addRod(tracker, vector(p), 0.006 * this.size, beams);
    if (!this.shown.poses) return;
    const faint = [];
    for (let k = 0; k < plan.count; ++k) for (const p of reflectors(k)) faint.push(...plan.tracker, ...p);
    this.addLines(faint, c.y, 0.25);
  }
}
