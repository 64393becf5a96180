// SPDX-License-Identifier: Apache-2.0
// Lines that say where things are: the cameras' frusta and a grid on the lowest that is seen.

import { add, clamp, dot, horizon, posed, scale, sub } from "./camera_math";
import type { Frame, Vec3 } from "./protocol";

/** [m] of the world's axes. */
export const AXES_LENGTH = 0.05;
const FRUSTUM = 0.08; // [m] of a camera's picture before it
const SMALLEST_CELL = 0.1; // [m] of the grid; ten times that, and so on, under larger scenes
const MOST_CELLS = 12; // to each side

/** A camera as a pyramid: the ends of its edges, x y z after one another; none without a lens. */
export function cameraLines(frame: Frame): number[] {
  if (frame.points) return [];
  const [fx, fy, cx, cy] = frame.intrinsics;
  const { width, height } = frame;
  const corners = [
    [-0.5, -0.5],
    [width - 0.5, -0.5],
    [width - 0.5, height - 0.5],
    [-0.5, height - 0.5],
  ].map(([u, v]) =>
    posed(frame.worldFromCamera, [((u! - cx) / fx) * FRUSTUM, ((v! - cy) / fy) * FRUSTUM, FRUSTUM]),
  );
  const tip = posed(frame.worldFromCamera, [0, 0, 0]);
  return corners.flatMap((corner, i) => [...tip, ...corner, ...corner, ...corners[(i + 1) % 4]!]);
}

/** The middle of the lowest of what is seen, and its reach [m]; null: that is little. */
export function floorUnder(places: readonly Vec3[], up: Vec3): { at: Vec3; reach: number } | null {
  if (places.length < 10) return null;
  const middle = scale(places.reduce(add), 1 / places.length);
  const away = places.map((place) => sub(place, middle));
  const at = (values: number[], share: number) =>
    values.sort((a, b) => a - b)[Math.floor(share * (values.length - 1))]!;
  const lowest = at(away.map((way) => dot(way, up)), 0.02);
  const reach = at(away.map((way) => Math.hypot(...sub(way, scale(up, dot(way, up))))), 0.9);
  return { at: add(middle, scale(up, lowest)), reach };
}

/** A grid of 0.1 m, 1 m, 10 m and so on about a floor, square to `up`; the ends of its lines. */
export function gridLines({ at, reach }: { at: Vec3; reach: number }, up: Vec3): number[] {
  const axes = horizon(up);
  const tens = Math.ceil(Math.log10(reach / (SMALLEST_CELL * MOST_CELLS)));
  const cell = SMALLEST_CELL * 10 ** clamp(tens, 0, 6);
  const cells = clamp(Math.ceil(reach / cell), 2, MOST_CELLS);
  // Whole cells from the world's origin.
  const offset = axes.map((axis) => cell * Math.round(dot(at, axis) / cell) - dot(at, axis));
  const middle = axes.reduce((sum, axis, i) => add(sum, scale(axis, offset[i]!)), at);
  const points: number[] = [];
  for (let i = -cells; i <= cells; ++i) {
    for (const [along, beside] of [axes, [axes[1], axes[0]] as const]) {
      const foot = add(middle, scale(beside, i * cell));
      points.push(...add(foot, scale(along, -cells * cell)));
      points.push(...add(foot, scale(along, cells * cell)));
    }
  }
  return points;
}
