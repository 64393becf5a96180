// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { Thinning } from "../src/thinning";

function run(thinning: Thinning, seconds: (stride: number) => number, frames: number): number {
  for (let i = 0; i < frames; ++i) thinning.measure(seconds(thinning.stride));
  return thinning.stride;
}

test("draws everything while that is fast", () => {
  expect(run(new Thinning(), () => 1 / 60, 300)).toBe(1);
});

test("draws less within a few frames where it is slow", () => {
  // 300 000 points take a third of a second, as on a processor without a graphics card.
  const cost = (stride: number) => 0.01 + 0.3 / stride ** 2;
  const thinning = new Thinning();
  expect(run(thinning, cost, 12)).toBeGreaterThanOrEqual(3);
  expect(cost(thinning.stride)).toBeLessThan(1 / 20);
});

test("draws more again when it has become fast", () => {
  const thinning = new Thinning();
  run(thinning, () => 0.2, 3);
  expect(thinning.stride).toBeGreaterThan(1);
  expect(run(thinning, () => 1 / 60, 5000)).toBe(1);
});

test("does not swing between two strides, one too slow and one fast", () => {
  const thinning = new Thinning();
  const cost = (stride: number) => (stride === 1 ? 0.08 : 0.01);
  let changes = 0;
  for (let i = 0, last = 1; i < 2000; ++i) {
    thinning.measure(cost(thinning.stride));
    if (thinning.stride !== last) ++changes;
    last = thinning.stride;
  }
  expect(changes).toBeLessThan(12);
});

test("takes no notice of a tab that slept", () => {
  expect(run(new Thinning(), () => 30, 100)).toBe(1);
});

test("where few points are slow, too, the picture gets coarser", () => {
  const thinning = new Thinning();
  expect(thinning.resolution).toBe(1);
  // A large window without a graphics card: the picture itself takes a tenth of a second.
  for (let i = 0; i < 60; ++i)
    thinning.measure(0.1 * thinning.resolution ** 2 + 0.3 / thinning.stride ** 2);
  expect(thinning.stride).toBe(6);
  expect(0.1 * thinning.resolution ** 2 + 0.3 / thinning.stride ** 2).toBeLessThan(1 / 20);
});
