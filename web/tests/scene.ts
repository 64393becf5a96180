// SPDX-License-Identifier: Apache-2.0
// Depth images of scenes whose geometry is known, for tests.

import { add, cross, dot, scale, sub, unit } from "../src/camera_math";
import type { Frame, Vec3 } from "../src/protocol";

export const WIDTH = 160;
export const HEIGHT = 120;
const F = 150; // [px]

/** Distance to what a ray meets first; infinite: nothing. `along` is not of length 1. */
export type Scene = (from: Vec3, along: Vec3) => number;

export const plane =
  (at: Vec3, normal: Vec3): Scene =>
  (from, along) => {
    const t = dot(sub(at, from), normal) / dot(along, normal);
    return t > 0 ? t : Infinity;
  };

/** A block with edges along the world's axes. */
export const block =
  (low: Vec3, high: Vec3): Scene =>
  (from, along) => {
    let [enter, leave] = [0, Infinity];
    for (const i of [0, 1, 2] as const) {
      const ends = [(low[i] - from[i]) / along[i], (high[i] - from[i]) / along[i]];
      enter = Math.max(enter, Math.min(...ends));
      leave = Math.min(leave, Math.max(...ends));
    }
    return enter < leave && enter > 0 ? enter : Infinity;
  };

export const both =
  (...scenes: Scene[]): Scene =>
  (from, along) =>
    Math.min(...scenes.map((scene) => scene(from, along)));

/** Columns of a camera's rotation that looks from `eye` to `target`: x right, y down, z forward. */
function rotation(eye: Vec3, target: Vec3): [Vec3, Vec3, Vec3] {
  const z = unit(sub(target, eye));
  const x = unit(cross(z, Math.abs(z[2]) < 0.95 ? [0, 0, 1] : [0, 1, 0]));
  return [x, cross(z, x), z];
}

/** What a camera at `eye` sees of a scene [units of 0.1 mm]. */
export function seen(scene: Scene, eye: Vec3, target: Vec3, noise: () => number = () => 0): Frame {
  const [x, y, z] = rotation(eye, target);
  const depth = new Uint16Array(WIDTH * HEIGHT);
  for (let v = 0; v < HEIGHT; ++v) {
    for (let u = 0; u < WIDTH; ++u) {
      const a = scale(x, (u - WIDTH / 2) / F);
      const along = add(add(a, scale(y, (v - HEIGHT / 2) / F)), z);
      const t = scene(eye, along) + noise();
      depth[v * WIDTH + u] = t < 6 ? Math.round(1e4 * t) : 0;
    }
  }
  return {
    kind: "frame",
    camera: 0,
    number: 0,
    stamp: 0,
    width: WIDTH,
    height: HEIGHT,
    intrinsics: [F, F, WIDTH / 2, HEIGHT / 2],
    metresPerUnit: 1e-4,
    worldFromCamera: Float32Array.from([0, 1, 2].flatMap((i) => [x[i]!, y[i]!, z[i]!, eye[i]!])),
    hasRays: false,
    depth,
    points: null,
    triangles: null,
    colour: null,
  };
}

/** The same as points without an image. */
export function asPoints(frame: Frame): Frame {
  const [fx, fy, cx, cy] = frame.intrinsics;
  const points: number[] = [];
  frame.depth!.forEach((raw, i) => {
    if (raw === 0) return;
    const z = raw * frame.metresPerUnit;
    const u = i % frame.width;
    const v = Math.floor(i / frame.width);
    points.push(((u - cx) / fx) * z, ((v - cy) / fy) * z, z);
  });
  const count = points.length / 3;
  return { ...frame, width: count, height: 1, depth: null, points: Float32Array.from(points) };
}

/**
 * A mesh as the camera of a frame gives it.
 * @param corners  [m, world]
 * @param triangles  three of them each
 */
export function asMesh(
  frame: Frame,
  corners: readonly Vec3[],
  triangles: readonly number[],
): Frame {
  const pose = frame.worldFromCamera;
  const eye: Vec3 = [pose[3]!, pose[7]!, pose[11]!];
  const axis = (i: number): Vec3 => [pose[i]!, pose[i + 4]!, pose[i + 8]!];
  const points = corners.flatMap((p) => [0, 1, 2].map((i) => dot(axis(i), sub(p, eye))));
  return {
    ...frame,
    width: corners.length,
    height: 1,
    depth: null,
    points: Float32Array.from(points),
    triangles: Uint32Array.from(triangles),
  };
}

/** Numbers of a normal distribution, always the same. */
export function normalNumbers(seed: number): () => number {
  let state = seed;
  const uniform = () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return (state + 0.5) / 2 ** 32;
  };
  return () => Math.sqrt(-2 * Math.log(uniform())) * Math.cos(2 * Math.PI * uniform());
}
