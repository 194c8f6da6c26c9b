// SPDX-License-Identifier: Apache-2.0
import {Vector3} from 'three';
import {vector} from './scene.js';

/** Moves a camera that looks from a direction so that it sees all places. \return the middle of its picture */
export function fitCamera(camera, from, places, size) {
  const towards = vector(from).normalize();
  camera.position.copy(towards);
  camera.lookAt(0, 0, 0);
  camera.updateMatrixWorld();
  const [right, above] = [0, 1].map((k) => new Vector3().setFromMatrixColumn(camera.matrixWorld, k));
  const tall = 0.92 * Math.tan((camera.fov * Math.PI) / 360);
  const wide = tall * camera.aspect;
  // Each place must lie inside the pyramid of the view: middle and distance follow from the outermost ones, first
  // without perspective.
  const extent = (axis) => {
    const at = places.map((p) => p.dot(axis));
    return [at.reduce((x, y) => Math.min(x, y)), at.reduce((x, y) => Math.max(x, y))];
  };
  const middle = new Vector3();
  for (const axis of [right, above, towards]) middle.addScaledVector(axis, extent(axis).reduce((x, y) => x + y) / 2);
  let distance = 0.3 * size;
  for (const p of places) {
    const at = p.clone().sub(middle);
    const depth = at.dot(towards) + 0.08 * size;
    distance = Math.max(distance, depth + Math.abs(at.dot(right)) / wide, depth + Math.abs(at.dot(above)) / tall);
  }
  camera.position.copy(middle).addScaledVector(towards, distance);
  camera.near = distance / 100;
  camera.far = distance * 20;
  camera.updateProjectionMatrix();
  return middle;
}

/** Turns a camera about a point: around the upright axis, and up or down, rad. */
export function turnCamera(camera, target, around, down) {
  const from = camera.position.clone().sub(target);
  const distance = from.length();
  const angle = Math.atan2(from.y, from.x) + around;
  const steep = Math.min(Math.max(Math.acos(from.z / distance) + down, 0.02), Math.PI - 0.02);
  camera.position.set(Math.sin(steep) * Math.cos(angle), Math.sin(steep) * Math.sin(angle), Math.cos(steep))
    .multiplyScalar(distance).add(target);
}
