// SPDX-License-Identifier: Apache-2.0
/**
 * The nominal arm as far as it is drawn: frames of the links by Rot(z,theta) Trans(z,d) Trans(x,a) Rot(x,alpha)
 * Rot(y,beta). What the calibrated arm does differently is far below a pixel.
 */

/** A rigid transform: columns x, y, z of the rotation and the origin, m. */
const identity = () => ({x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1], origin: [0, 0, 0]});

const sum = (a, s, b, t) => [a[0] * s + b[0] * t, a[1] * s + b[1] * t, a[2] * s + b[2] * t];

/** A point or direction of the frame, in F0. */
export function direction(frame, v) {
  return [0, 1, 2].map((i) => frame.x[i] * v[0] + frame.y[i] * v[1] + frame.z[i] * v[2]);
}
export function placed(frame, p) {
  return sum(direction(frame, p), 1, frame.origin, 1);
}

function advance(from, [theta, d, a, alpha, beta], q) {
  const c = Math.cos(theta + q);
  const s = Math.sin(theta + q);
  let x = sum(from.x, c, from.y, s);
  let y = sum(from.y, c, from.x, -s);
  let {z} = from;
  const elbow = sum(from.origin, 1, z, d);
  const origin = sum(elbow, 1, x, a);
  const ca = Math.cos(alpha);
  const sa = Math.sin(alpha);
  [y, z] = [sum(y, ca, z, sa), sum(z, ca, y, -sa)];
  const cb = Math.cos(beta);
  const sb = Math.sin(beta);
  [x, z] = [sum(x, cb, z, -sb), sum(x, sb, z, cb)];
  return {x, y, z, origin, elbow};
}

/** Frames 0 … 6 in F0; `elbow` of each is where its link turns from along z to along x. */
export function chain(arm, q) {
  const frames = [identity()];
  arm.links.forEach((link, i) => frames.push(advance(frames[i], link, q[i])));
  return frames;
}

/** Ftool in F0. */
export function toolFrame(arm, flange) {
  const [w, x, y, z] = arm.tool_wxyz;
  const turned = [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ].map((column) => direction(flange, column));
  return {x: turned[0], y: turned[1], z: turned[2], origin: placed(flange, arm.tool)};
}

/** Where the measured point of a pose is, in F0. */
export function measuredPoint(arm, q, point = [0, 0, 0]) {
  return placed(toolFrame(arm, chain(arm, q)[6]), point);
}
