// SPDX-License-Identifier: Apache-2.0
// Lines that say where things are: the cameras' frusta and a grid on the lowest that is seen.

import { add, clamp, cross, dot, scale, sub, unit } from "./camera_math";
import type { Frame, Vec3 } from "./protocol";

/** [m] of the world's axes. */
export const AXES_LENGTH = 0.05;
const FRUSTUM = 0.08; // [m] of a camera's picture before it
const CELL = 0.1; // [m] of the grid
const MOST_CELLS = 12; // to each side

function toWorld({ worldFromCamera: m }: Frame, p: Vec3): Vec3 {
  return [0, 4, 8].map(
    (row) => m[row]! * p[0] + m[row + 1]! * p[1] + m[row + 2]! * p[2] + m[row + 3]!,
  ) as unknown as Vec3;
}

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
    toWorld(frame, [((u! - cx) / fx) * FRUSTUM, ((v! - cy) / fy) * FRUSTUM, FRUSTUM]),
  );
  const tip = toWorld(frame, [0, 0, 0]);
  return corners.flatMap((corner, i) => [...tip, ...corner, ...corner, ...corners[(i + 1) % 4]!]);
}

/** The middle of the lowest that a camera sees, and its reach [m]; null: it sees little. */
export function floorUnder(frame: Frame, up: Vec3): { at: Vec3; reach: number } | null {
  const places: Vec3[] = [];
  const count = frame.width * frame.height;
  const step = Math.max(1, Math.floor(count / 1997));
  for (let i = 0; i < count; i += step) {
    if (frame.points) {
      const [x, y, z] = frame.points.subarray(3 * i, 3 * i + 3);
      places.push(toWorld(frame, [x!, y!, z!]));
      continue;
    }
    const raw = frame.depth![i]!;
    if (raw === 0 || raw === 65535) continue;
    const z = raw * frame.metresPerUnit;
    const [fx, fy, cx, cy] = frame.intrinsics;
    const u = i % frame.width;
    const v = Math.floor(i / frame.width);
    places.push(toWorld(frame, [((u - cx) / fx) * z, ((v - cy) / fy) * z, z]));
  }
  if (places.length < 10) return null;
  const middle = scale(places.reduce(add), 1 / places.length);
  const away = places.map((place) => sub(place, middle));
  const at = (values: number[], share: number) =>
    values.sort((a, b) => a - b)[Math.floor(share * (values.length - 1))]!;
  const lowest = at(
    away.map((way) => dot(way, up)),
    0.02,
  );
  const reach = at(
    away.map((way) => Math.hypot(...sub(way, scale(up, dot(way, up))))),
    0.9,
  );
  return { at: add(middle, scale(up, lowest)), reach };
}

/** A grid of 0.1 m about a floor, square to `up`; the ends of its lines. */
export function gridLines({ at, reach }: { at: Vec3; reach: number }, up: Vec3): number[] {
  const first = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
  const axes = [first, cross(up, first)] as const;
  const cells = clamp(Math.ceil(reach / CELL), 2, MOST_CELLS);
  // Whole cells from the world's origin.
  const offset = axes.map((axis) => CELL * Math.round(dot(at, axis) / CELL) - dot(at, axis));
  const middle = axes.reduce((sum, axis, i) => add(sum, scale(axis, offset[i]!)), at);
  const points: number[] = [];
  for (let i = -cells; i <= cells; ++i) {
    for (const [along, beside] of [axes, [axes[1], axes[0]] as const]) {
      const foot = add(middle, scale(beside, i * CELL));
      points.push(...add(foot, scale(along, -cells * CELL)));
      points.push(...add(foot, scale(along, cells * CELL)));
    }
  }
  return points;
}
