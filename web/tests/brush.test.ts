// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { brushOf, dabColour, paintText } from "../src/brush";

test("a brush is off, a material or the eraser, of a size that can be", () => {
  expect(brushOf("none", 10)).toBeNull();
  expect(brushOf("wood", 10)).toEqual({ material: "wood", radius: 0.01 });
  expect(brushOf("erase", 30)).toEqual({ material: "", radius: 0.03 });
  expect(brushOf("wood", 0)?.radius).toBe(0.002);
  expect(brushOf("wood", 1e9)?.radius).toBe(0.05);
  expect(brushOf("wood", Number.NaN)?.radius).toBe(0.01);
});

test("materials have colours of their own", () => {
  const names = ["ice", "metal", "wood", "rubber", "foam"];
  expect(new Set(names.map((name) => dabColour(name, names))).size).toBe(names.length);
});

test("says what the brush does, and what is wrong with it", () => {
  const paint = { brush: null, dabs: [], materials: [], trouble: "" };
  const at: [number, number, number] = [0, 0, 0];
  const dab = { place: at, normal: at, radius: 0.01, material: "ice" };
  expect(paintText(paint)).toBe("");
  expect(paintText({ ...paint, dabs: [dab] })).toBe("1 dab of paint.");
  expect(paintText({ ...paint, brush: { material: "ice", radius: 0.01 } })).toContain("painted");
  expect(paintText({ ...paint, brush: { material: "", radius: 0.01 } })).toContain("wiped");
  expect(paintText({ ...paint, trouble: "brush: it is full" })).toBe("Brush: it is full.");
});
