// SPDX-License-Identifier: Apache-2.0
import { describe, expect, test } from "vitest";
import type { Vec3 } from "../src/protocol";
import { depthBelow, flagNames, SteadyWhy, why, type Facts } from "../src/why";

const r_c = 0.005;
const up: Vec3 = [0, 0, 1];

test("depth is that of the hand below the surface, not below the proxy", () => {
  const proxy: Vec3 = [0, 0, r_c]; // on z = 0
  expect(depthBelow({ hip: [0, 0, 0.0048], proxy, normal: up }, r_c)).toBeCloseTo(-0.0048, 12);
  expect(depthBelow({ hip: [0, 0, -0.003], proxy, normal: up }, r_c)).toBeCloseTo(0.003, 12);
  expect(depthBelow({ hip: [0.02, 0, -0.003], proxy, normal: up }, r_c)).toBeCloseTo(0.003, 12);
  expect(depthBelow({ hip: [0, 0, -0.003], proxy, normal: [0, 0, 0] }, r_c)).toBeCloseTo(0.003, 12);
});

test("flags have the names of the program's table", () => {
  const table = ["a", "b", "c"].map((name) => ({ name, meaning: "" }));
  expect(flagNames(0b101, table)).toEqual(["a", "c"]);
  expect(flagNames(0, table)).toEqual([]);
});

const facts = (flags: string[], more: Partial<Facts> = {}): Facts => ({
  connected: true,
  tick: {
    ...{ state: 1, gain: 0.4, askedForce: 9, force: [0, 0, 2] as const },
    ...{ hip: [0, 0, -0.002], proxy: [0, 0, r_c], normal: up },
  },
  flags: new Set(flags),
  hand: "you",
  state: {
    latched_by: ["input_refused"],
    device: { uri: "mouse:", kind: "mouse", takes_hand: true, fault: "", warnings: [] },
    parameters: { stiffness: 600, r_c },
  },
  ...more,
});
const air = { ...facts([]).tick!, state: 0 };

describe("why the force is what it is", () => {
  test("the coupling's own numbers, if nothing else decides", () => {
    expect(why(facts([])).text).toBe("Stiffness 600 N/m times 2.0 mm.");
    expect(why(facts([], { tick: air })).text).toContain("in the air");
    const touches = { ...facts([]).tick!, hip: [0, 0, 0.002] as const };
    expect(why(facts([], { tick: touches })).text).toContain("still above the surface");
  });

  test.each([
    ["force_cut", /Limited.*9.0 N/],
    ["continuous_cut", /warm.*9.0 N/],
    ["ramping", /Rising.*40 %/],
    ["surface_hidden", /hides/],
    ["frame_fading", /frame is old/],
    ["frame_late", /overdue/],
    ["frame_lost", /No force.*no usable frame/],
    ["no_frame", /no frame to touch/],
    ["disengaged", /pull back/],
    ["fault_latched", /input_refused/],
    ["energy_cut", /oscillation/],
  ])("%s is named", (flag, text) => {
    expect(why(facts([flag]))).toMatchObject({ link: flag, text: expect.stringMatching(text) });
  });

  test("what takes the force away comes before what limits it", () => {
    expect(why(facts(["slew_cut", "force_cut", "ramping"])).link).toBe("ramping");
    expect(why(facts(["ramping", "disengaged"])).link).toBe("disengaged");
    expect(why(facts(["disengaged", "frame_lost", "frame_fading"])).link).toBe("frame_lost");
    expect(why(facts(["frame_lost", "fault_latched"])).link).toBe("fault_latched");
  });

  test("what changes the force by nothing that is noticed is not why", () => {
    const tick = { ...facts([]).tick!, askedForce: 2.01 };
    expect(why(facts(["slew_cut", "pull_removed"], { tick })).text).toContain("Stiffness");
    expect(why(facts(["slew_cut"])).link).toBe("slew_cut");
  });

  test("a hand that nobody holds, that is lost, or a program that is silent", () => {
    expect(why(facts(["disengaged"], { hand: "free" })).text).toMatch(/nobody holds.*Press/);
    expect(why(facts(["disengaged"], { tick: air })).text).toContain("in the air");
    const { state } = facts([]);
    const lost = { ...state!, device: { ...state!.device, fault: "unplugged" } };
    expect(why(facts(["input_refused"], { state: lost })).text).toContain("lost: unplugged");
    expect(why(facts([], { connected: false })).text).toContain("No word");
    expect(why(facts([], { tick: null })).text).toContain("No tick");
  });

  test("in the air a ramp says nothing", () => {
    expect(why(facts(["ramping", "surface_hidden"], { tick: air })).text).toContain("in the air");
  });
});

test("a line stays long enough to be read, unless a graver one comes", () => {
  const steady = new SteadyWhy();
  const [cut, plain, lost] = [["slew_cut"], [], ["frame_lost"]].map((flags) => why(facts(flags)));
  expect(steady.show(plain!, 0)).toBe(plain);
  expect(steady.show(cut!, 10)).toBe(cut);
  expect(steady.show(plain!, 100)).toBe(cut);
  expect(steady.show(lost!, 110)).toBe(lost);
  expect(steady.show(plain!, 500)).toBe(lost);
  expect(steady.show(plain!, 700)).toBe(plain);
});
