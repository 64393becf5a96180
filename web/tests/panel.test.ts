// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import {
  cameraText,
  enteredNumber,
  latchedText,
  maySetLimit,
  shownUnit,
  shortNumber,
  sliderFromValue,
  stiffnessFirst,
  toolName,
  valueFromSlider,
  warningText,
  whyNot,
} from "../src/panel";

test("tools have names for people", () => {
  expect(toolName("ball")).toBe("ball");
  expect(toolName("box:40x20x5mm?points=100")).toBe("box 40 × 20 × 5 mm");
  expect(toolName("mesh:parts/a:b.stl?unit=mm")).toBe("a:b.stl");
});

test("a slider's ends are the range's ends, to the bit", () => {
  for (const row of [
    { min: 1e-4, max: 0.05 },
    { min: 0, max: 20 },
    { min: 0.001, max: 0.99 },
    { min: 0, max: 1e5, default: 600 },
  ]) {
    expect(valueFromSlider(row, 0)).toBe(row.min);
    expect(valueFromSlider(row, 1000)).toBe(row.max);
    expect(sliderFromValue(row, row.min)).toBe(0);
    expect(sliderFromValue(row, row.max)).toBe(1000);
  }
});

test("a wide range is divided by ratios", () => {
  expect(valueFromSlider({ min: 0.01, max: 100 }, 500)).toBeCloseTo(1, 9);
  expect(valueFromSlider({ min: 0, max: 10 }, 500)).toBeCloseTo(5, 9);
  // Also one that begins at zero, if its default is a small part of it: a soft spring is in reach.
  const stiffness = { min: 0, max: 1e5, default: 600 };
  expect(sliderFromValue(stiffness, 600)).toBe(474);
  expect(valueFromSlider(stiffness, 474)).toBe(602);
  expect(valueFromSlider(stiffness, 1)).toBe(6.06);
  expect(valueFromSlider({ min: 0, max: 50, default: 3.3 }, 500)).toBe(25);
});

test("a value finds its place on the slider again", () => {
  const row = { min: 1e-4, max: 0.05 };
  for (const slider of [1, 250, 500, 999])
    expect(Math.abs(sliderFromValue(row, valueFromSlider(row, slider)) - slider)).toBeLessThan(2);
});

test("millimetres and degrees are shown, not their thousandths", () => {
  expect(shownUnit({ unit: "m", max: 0.05 })).toEqual({ unit: "mm", factor: 1000 });
  expect(shownUnit({ unit: "rad", max: 0.5 }).unit).toBe("°");
  expect(shownUnit({ unit: "-", max: 1 }).unit).toBe("");
  expect(shownUnit({ unit: "N/m", max: 1e5 })).toEqual({ unit: "N/m", factor: 1 });
  expect(shortNumber(5.0000000001)).toBe("5");
});

test("an empty field is no number, least of all zero", () => {
  for (const nothing of ["", "  ", "-", "1e", "NaN", "Infinity", "1,5"])
    expect(enteredNumber(nothing)).toBeNull();
  expect(enteredNumber("0")).toBe(0);
  expect(enteredNumber(" 1.5e2 ")).toBe(150);
});

test("stiffness comes first, the others as the program lists them", () => {
  const rows = ["r_c", "stiffness", "damping"].map((name) => ({ name }));
  expect(stiffnessFirst(rows).map(({ name }) => name)).toEqual(["stiffness", "r_c", "damping"]);
});

test("each role may set what the program lets it set, and is told why not the rest", () => {
  expect(maySetLimit("looking", { stricter: "lower" })).toBe(false);
  expect(maySetLimit("holding", { stricter: "lower" })).toBe(true);
  expect(maySetLimit("holding", { stricter: "" })).toBe(false);
  expect(maySetLimit("operating", { stricter: "" })).toBe(true);
  expect(Object.values(whyNot("operating")).join("")).toBe("");
  for (const role of ["looking", "holding"] as const)
    for (const why of Object.values(whyNot(role))) expect(why).toContain("operator's link");
});

test("latched faults are named, and only the operator is asked to reset them", () => {
  expect(latchedText({ role: "operating", latched_by: [] })).toBe("");
  const latched_by = ["input_refused", "direction_refused"];
  expect(latchedText({ role: "operating", latched_by })).toMatch(
    /input_refused, direction_refused.*then reset them/,
  );
  for (const role of ["looking", "holding"] as const)
    expect(latchedText({ role, latched_by })).toMatch(/input_refused.*operator's link/);
});

test("warnings are sentences, one after the other", () => {
  expect(warningText([])).toBe("");
  expect(warningText(["walls are stiff; set 400", "it may swing"])).toBe(
    "Walls are stiff; set 400. It may swing.",
  );
});

test("what is looked at says whether it goes on, and what was left out", () => {
  const camera = {
    ...{ uri: "tum:/data/desk", kind: "", sensor: "unknown", rate: 30, state: "live" },
    ...{ stays_valid: false, dropped: 0, frames: 0, place: 0, time: 0 },
  };
  const playback = { paused: false, loop: false, speed: 1 };
  const said = (more: Partial<typeof camera>, how: typeof playback | null = playback) =>
    cameraText({ cameras: [{ ...camera, ...more }], playback: how });
  expect(said({}, null)).toBe("desk · 30 Hz");
  const stays_valid = true;
  expect(said({ frames: 1, stays_valid })).toBe("desk · still picture");
  expect(said({ frames: 90, dropped: 1200 })).toBe("desk · 30 Hz · 1,200 frames dropped");
  const paused = { ...playback, paused: true };
  const again = { ...paused, loop: true };
  expect(said({ frames: 90, place: 4, stays_valid }, again)).toBe("desk · paused");
  const ended = "ended, its last frame stays";
  expect(said({ frames: 90, place: 89, stays_valid }, paused)).toBe(`desk · ${ended}`);
  expect(said({ frames: 90, place: 89, stays_valid }, again)).toBe("desk · paused");
  // What a camera that stopped saw is not declared valid, whatever its place.
  expect(said({ place: 89, state: "waiting: no frame for 0.4 s" })).toContain("waiting");
  expect(said({ state: "searching: unplugged" })).toBe("desk · searching: unplugged");
  expect(cameraText({ cameras: [], playback: null })).toBe("no camera");
});
