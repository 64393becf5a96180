// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { stickOf } from "../src/gamepad";

const pad = (axes: number[], triggers = [0, 0]) => ({
  axes,
  buttons: [...Array(6).fill(0), ...triggers].map((value) => ({
    value,
    pressed: value > 0,
    touched: value > 0,
  })),
});

test("sticks move the hand, triggers push it in and pull it back", () => {
  expect(stickOf([null, pad([1, 0, 0, 0])])).toEqual({ x: 1, y: 0, into: 0 });
  expect(stickOf([pad([0, 0, 0, -1])])!.into).toBe(1);
  expect(stickOf([pad([0, 0, 0, 0], [0, 1])])!.into).toBe(1);
  expect(stickOf([pad([0, 0], [1, 0])])!.into).toBe(-1);
});

test("a stick that rests a little beside its middle asks for nothing", () => {
  expect(stickOf([pad([0.1, -0.14, 0, 0.1])])).toBeNull();
  expect(stickOf([])).toBeNull();
});
