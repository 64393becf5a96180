// SPDX-License-Identifier: Apache-2.0
import { describe, expect, test } from "vitest";
import {
  approach,
  axes,
  cross,
  depthOf,
  dot,
  dragged,
  eye,
  FIELD_OF_VIEW,
  length,
  lookAt,
  metresPerPixel,
  sub,
  turned,
  upFromPose,
  zoomed,
  type Orbit,
} from "../src/camera_math";
import type { Vec3 } from "../src/protocol";

const orbits: Orbit[] = [
  lookAt([0.3, -0.5, 0.6], [0, 0, 0], [0, 0, 1]),
  lookAt([0, 0, -1], [0, 0.1, 0.5], [0, -1, 0]),
  lookAt([2, 1, 0.5], [1, 1, 1], [0, 0, 1]),
];

const near = (a: Vec3, b: Vec3) => expect(length(sub(a, b))).toBeLessThan(1e-9);

describe.each(orbits)("an eye", (orbit) => {
  test("looks along unit axes that are square to each other", () => {
    const { right, up, forward } = axes(orbit);
    for (const axis of [right, up, forward]) expect(length(axis)).toBeCloseTo(1, 12);
    near(cross(right, up), [-forward[0], -forward[1], -forward[2]]);
    expect(dot(up, orbit.up)).toBeGreaterThan(0);
  });

  test("is where it was put", () => {
    near(eye(lookAt(eye(orbit), orbit.target, orbit.up)), eye(orbit));
    expect(depthOf(orbit, orbit.target)).toBeCloseTo(orbit.distance, 12);
  });

  test("keeps its distance when turned, and never tips over", () => {
    const there = turned(orbit, 0.7, -0.2);
    expect(length(sub(eye(there), orbit.target))).toBeCloseTo(orbit.distance, 12);
    near(eye(turned(there, -0.7, 0.2)), eye(orbit));
    expect(turned(orbit, 0, 100).pitch).toBeLessThan(Math.PI / 2);
  });

  test("comes neither into its target nor out of the world", () => {
    expect(zoomed(orbit, 1e-9).distance).toBeGreaterThan(0);
    expect(zoomed(orbit, 1e9).distance).toBeLessThan(1000);
    expect(zoomed(orbit, 0.5).distance).toBeCloseTo(0.5 * orbit.distance, 12);
  });

  test("a hand follows the pointer: so many pixels, so far in the view plane", () => {
    const height = 800;
    const { right, up, forward } = axes(orbit);
    const moved = sub(dragged(orbit, orbit.target, { x: 10, y: 4 }, 0.003, height), orbit.target);
    // By the definition of the angle of view, not by metresPerPixel.
    const pixel = (2 * orbit.distance * Math.tan(FIELD_OF_VIEW / 2)) / height;
    expect(dot(moved, right)).toBeCloseTo(10 * pixel, 12);
    expect(dot(moved, up)).toBeCloseTo(-4 * pixel, 12);
    expect(dot(moved, forward)).toBeCloseTo(0.003, 12);
  });
});

test("a pixel covers twice as much twice as far away", () => {
  expect(metresPerPixel(2, 600)).toBeCloseTo(2 * metresPerPixel(1, 600), 12);
});

test("up is -y for a camera's own frame and z for a world", () => {
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
  const lookingDown = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0.7];
  expect(upFromPose(identity)).toEqual([0, -1, 0]);
  expect(upFromPose(lookingDown)).toEqual([0, 0, 1]);
});

test("a hand is kept within reach of what it touches", () => {
  expect(approach([0, 0, 0], [0, 0, 0.03], 0.05)).toEqual([0, 0, 0.03]);
  near(approach([0, 0.1, 0], [0, 0.3, 0], 0.05), [0, 0.15, 0]);
});
