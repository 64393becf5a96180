// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { fixtureLines, forbidOf, guideOf } from "../src/fixtures";
import type { FixtureState } from "../src/protocol";

const shifted = [1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, -0.25];

function fixture(shape: FixtureState["shape"]): FixtureState {
  return {
    name: "a",
    kind: "forbidden",
    shape,
    pose: shifted,
    size: [0.2, 0.4, 0.6],
    radius: 0.1,
    length: 0.3,
    points: [
      [0, 0, 0],
      [0.1, 0, 0],
      [0.1, 0.2, 0],
    ],
  };
}

/** The reach of the lines' ends along each axis. */
function reach(shape: FixtureState["shape"]): number[][] {
  const ends = fixtureLines(fixture(shape));
  return [0, 1, 2].map((axis) => {
    const along = ends.filter((_, i) => i % 3 === axis);
    return [Math.min(...along), Math.max(...along)].map((x) => Math.round(1e6 * x) / 1e6);
  });
}

test("fixtures are drawn where they are, as large as they are", () => {
  const box = [
    [0.4, 0.6],
    [-0.2, 0.2],
    [-0.55, 0.05],
  ];
  for (const shape of ["box", "seen", "mesh"] as const) expect(reach(shape)).toEqual(box);
  expect(reach("sphere")).toEqual([
    [0.4, 0.6],
    [-0.1, 0.1],
    [-0.35, -0.15],
  ]);
  expect(reach("cylinder")[2]).toEqual([-0.4, -0.1]);
  expect(reach("capsule")[2]).toEqual([-0.5, 0]);
  expect(reach("half_space")[2]).toEqual([-0.25, -0.25]);
  expect(reach("path")).toEqual([
    [0.5, 0.6],
    [0, 0.2],
    [-0.25, -0.25],
  ]);
  expect(fixtureLines(fixture("point"))).toHaveLength(18);
  expect(fixtureLines(fixture("box"))).toHaveLength(72);
});

test("a region that is asked for is of a size that can be", () => {
  expect(forbidOf(100, 10)).toEqual({ size: 0.1, margin: 0.01 });
  expect(forbidOf(Number.NaN, Number.NaN)).toEqual({ size: 0.1, margin: 0.01 });
  expect(forbidOf(1, 1000)).toEqual({ size: 0.01, margin: 0.1 });
  expect(guideOf(3)).toEqual({ slack: 0.003 });
  expect(guideOf(Number.NaN)).toEqual({ slack: 0.002 });
  expect(guideOf(-1)).toEqual({ slack: 0 });
});
