// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import type { Ticks, Vec3 } from "../src/protocol";
import { NOTHING, sensationOf } from "../src/senses";

function tick(t: number, newtons: number, proxy: Vec3, state = 1): Ticks {
  return {
    ...{ kind: "ticks", state, flags: 0, safety: 0, t, steps: 1, frame: 0, hip: proxy, proxy },
    ...{ normal: [0, 0, 1], force: [0, 0, newtons], surfaceVelocity: 0, gain: 1 },
    ...{ askedForce: newtons, place: proxy, region: 0, guidance: 0, fixtures: 0, samples: [] },
    ...{ orientation: [0, 0, 0, 1], proxyOrientation: [0, 0, 0, 1] },
    ...{ torque: [0, 0, 0], contacts: [] },
  };
}

test("no force is heard or felt as nothing", () => {
  expect(sensationOf(null, tick(1, 0, [0, 0, 0]))).toEqual(NOTHING);
  expect(sensationOf(tick(1, 0, [0, 0, 0]), tick(1.03, 0, [0.1, 0, 0]))).toEqual(NOTHING);
  expect(sensationOf(null, tick(1, 0.5, [0, 0, 0], 0))).toEqual(NOTHING);
});

test("a push is as strong as its force, up to all there is", () => {
  const push = (newtons: number) => sensationOf(null, tick(1, newtons, [0, 0, 0])).push;
  expect(push(1.5)).toBeCloseTo(0.5, 9);
  expect(push(3)).toBe(1);
  expect(push(50)).toBe(1);
});

test("sliding is heard by its speed along the surface, going in and out is not", () => {
  const first = tick(1, 3, [0, 0, 0]);
  const after = (proxy: Vec3) => sensationOf(first, tick(1.1, 3, proxy)).slide;
  expect(after([0.0075, 0, 0])).toBeCloseTo(0.5, 9); // 0.075 m/s
  expect(after([0, 1, 0])).toBe(1);
  expect(after([0, 0, 0.01])).toBe(0);
  // A proxy that was elsewhere before it touched has not slid here.
  expect(sensationOf(tick(1, 0, [1, 0, 0], 0), tick(1.1, 3, [0, 0, 0])).slide).toBe(0);
  expect(sensationOf(first, tick(1, 3, [0.01, 0, 0])).slide).toBe(0);
});
