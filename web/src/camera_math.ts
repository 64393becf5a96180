// SPDX-License-Identifier: Apache-2.0
// The eye that looks at the scene, as numbers: where it is, how drags move it, and how a drag in
// the picture moves the hand in the world.

import type { Vec3 } from "./protocol";

export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a: Vec3): number => Math.hypot(a[0], a[1], a[2]);
export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const unit = (a: Vec3): Vec3 => scale(a, 1 / (length(a) || 1));

export const clamp = (x: number, low: number, high: number): number =>
  Math.min(high, Math.max(low, x));

/** Full angle of view from top to bottom [rad]. */
export const FIELD_OF_VIEW = (45 * Math.PI) / 180;
const NEAREST = 0.02;
const FARTHEST = 900;
const STEEPEST = (88 * Math.PI) / 180;

/** An eye on a sphere about what it looks at. */
export interface Orbit {
  readonly target: Vec3;
  readonly distance: number; // [m]
  readonly yaw: number; // [rad] about `up`
  readonly pitch: number; // [rad] above the plane across `up`
  readonly up: Vec3; // [-] unit vector, world
}

/** Two unit vectors that make a right-handed frame with `up`. */
export function horizon(up: Vec3): [Vec3, Vec3] {
  const any: Vec3 = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
  const first = unit(sub(any, scale(up, dot(any, up))));
  return [first, cross(up, first)];
}

/** The picture's axes in the world: right, up and into the picture. */
export function axes(orbit: Orbit): { right: Vec3; up: Vec3; forward: Vec3 } {
  const [a, b] = horizon(orbit.up);
  const flat = add(scale(a, Math.cos(orbit.yaw)), scale(b, Math.sin(orbit.yaw)));
  const back = add(scale(flat, Math.cos(orbit.pitch)), scale(orbit.up, Math.sin(orbit.pitch)));
  const forward = scale(back, -1);
  const right = unit(cross(forward, orbit.up));
  return { right, up: cross(right, forward), forward };
}

/** Where the eye is [m, world]. */
export function eye(orbit: Orbit): Vec3 {
  return add(orbit.target, scale(axes(orbit).forward, -orbit.distance));
}

/** An orbit whose eye is at `from` and looks at `target`. */
export function lookAt(from: Vec3, target: Vec3, up: Vec3): Orbit {
  const back = sub(from, target);
  const distance = clamp(length(back), NEAREST, FARTHEST);
  const direction = unit(back);
  const [a, b] = horizon(up);
  return {
    target,
    distance,
    yaw: Math.atan2(dot(direction, b), dot(direction, a)),
    pitch: clamp(Math.asin(clamp(dot(direction, up), -1, 1)), -STEEPEST, STEEPEST),
    up,
  };
}

/** Turns the eye about its target. Angles in rad. */
export function turned(orbit: Orbit, yaw: number, pitch: number): Orbit {
  return { ...orbit, yaw: orbit.yaw + yaw, pitch: clamp(orbit.pitch + pitch, -STEEPEST, STEEPEST) };
}

/** Moves the eye towards its target (factor < 1) or away from it. */
export function zoomed(orbit: Orbit, factor: number): Orbit {
  return { ...orbit, distance: clamp(orbit.distance * factor, NEAREST, FARTHEST) };
}

/** [m] in the plane across the view, `depth` metres before the eye, that one pixel covers. */
export function metresPerPixel(depth: number, viewHeight: number): number {
  return (2 * depth * Math.tan(FIELD_OF_VIEW / 2)) / Math.max(viewHeight, 1);
}

/** How far `point` is before the eye [m], at least a little. */
export function depthOf(orbit: Orbit, point: Vec3): number {
  return Math.max(dot(sub(point, eye(orbit)), axes(orbit).forward), NEAREST);
}

/** Where the eye looks through a place of the picture [px, from its target's]: unit, world. */
export function rayThrough(orbit: Orbit, x: number, y: number, viewHeight: number): Vec3 {
  const { right, up, forward } = axes(orbit);
  const size = metresPerPixel(1, viewHeight);
  return unit(add(forward, sub(scale(right, x * size), scale(up, y * size))));
}

/** `point` moved by pixels in the view plane through it, and by metres into the picture. */
export function dragged(
  orbit: Orbit,
  point: Vec3,
  pixels: { x: number; y: number },
  into: number,
  viewHeight: number,
): Vec3 {
  const { right, up, forward } = axes(orbit);
  const size = metresPerPixel(depthOf(orbit, point), viewHeight);
  const across = add(scale(right, pixels.x * size), scale(up, -pixels.y * size));
  return add(add(point, across), scale(forward, into));
}

/** A place before a camera, in the world. @param pose  3 x 4, row by row */
export function posed(pose: ArrayLike<number>, p: Vec3): Vec3 {
  return [0, 4, 8].map(
    (row) => pose[row]! * p[0] + pose[row + 1]! * p[1] + pose[row + 2]! * p[2] + pose[row + 3]!,
  ) as unknown as Vec3;
}

/** `from`, moved by at most `most` metres towards `to`. */
export function approach(from: Vec3, to: Vec3, most: number): Vec3 {
  const way = sub(to, from);
  const distance = length(way);
  return distance <= most ? to : add(from, scale(way, most / distance));
}

/**
 * The world's up, as far as a camera's pose tells (3 x 4, row by row). A camera whose forward axis
 * is the world's z has its own frame as the world: up is its -y. Otherwise the world's z is up.
 */
export function upFromPose(pose: ArrayLike<number>): Vec3 {
  const forwardZ = pose[10] ?? 1;
  return forwardZ > 0.9 ? [0, -1, 0] : [0, 0, 1];
}
