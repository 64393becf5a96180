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
    ...{ state: 1, gain: 0.4, askedForce: 9, force: [0, 0, 1.2] as const, frame: 7 },
    ...{ hip: [0, 0, -0.002], proxy: [0, 0, r_c], normal: up, place: [0, 0, r_c] },
    ...{ region: 0, guidance: 0, fixtures: 0, flags: 0, safety: 0, surfaceVelocity: 0 },
  },
  flags: new Set(flags),
  hand: "you",
  state: {
    device: { uri: "mouse:", kind: "mouse", takes_hand: true, fault: "", warnings: [] },
    parameters: { stiffness: 600, r_c },
    tool: "ball",
  },
  acting: [],
  clearance: 0.03,
  spacing: 0.001,
  ...more,
});
type Tick = NonNullable<Facts["tick"]>;
const tick = (more: Partial<Tick>): Tick => ({ ...facts([]).tick!, ...more });
const air = tick({ state: 0, force: [0, 0, 0], askedForce: 0, normal: [0, 0, 0] });
const none = tick({ force: [0, 0, 0] });

describe("why the force is what it is", () => {
  test("the coupling's own numbers, if nothing else decides", () => {
    expect(why(facts([])).text).toBe("Stiffness 600 N/m times 2.0 mm.");
    expect(why(facts([])).detail).toBe("hand 2.0 mm inside");
    expect(why(facts([], { tick: tick({ force: [0, 0, 0.24] }) })).text).toBe(
      "Stiffness 120 N/m times 2.0 mm.", // of another material
    );
    expect(why(facts([], { tick: air })).text).toContain("in the air");
    // A tool with a shape touches with its own surface.
    const state = { ...facts([]).state!, tool: "box:40x20x5mm" };
    const box = why(facts([], { state, tick: tick({ proxy: [0, 0, 0], place: [0, 0, 0] }) }));
    expect(box.detail).toBe("hand 2.0 mm inside");
    const touches = tick({ hip: [0, 0, 0.002], force: [0, 0, 0], askedForce: 0 });
    expect(why(facts([], { tick: touches })).text).toContain("still above the surface");
  });

  test.each([
    ["force_cut", /Limited.*9.0 N/],
    ["continuous_cut", /warm.*9.0 N/],
    ["ramping", /Rising.*40 %/],
    ["surface_hidden", /hides/],
    ["frame_fading", /frame is old/],
    ["frame_late", /overdue/],
    ["energy_cut", /oscillation/],
  ])("%s, which changes it, is named", (flag, text) => {
    expect(why(facts([flag]))).toMatchObject({ link: flag, text: expect.stringMatching(text) });
  });

  test.each([
    ["frame_lost", /^No force.*no usable frame/],
    ["no_frame", /^No force.*no frame to touch/],
    ["disengaged", /^No force.*pull back/],
    ["fault_latched", /^No force.*again and again/],
  ])("%s, which takes it away, is named", (flag, text) => {
    const said = why(facts([flag, "slew_cut"], { tick: none }));
    expect(said).toMatchObject({ link: flag, text: expect.stringMatching(text) });
    expect(why(facts([flag])).text).not.toContain("No force"); // it did so some ticks ago
  });

  test("what takes the force away comes before what limits it", () => {
    const link = (flags: string[]) => why(facts(flags, { tick: none })).link;
    expect(link(["slew_cut", "force_cut", "ramping"])).toBe("ramping");
    expect(link(["ramping", "disengaged"])).toBe("disengaged");
    expect(link(["disengaged", "frame_lost", "frame_fading"])).toBe("frame_lost");
    expect(link(["frame_lost", "fault_latched"])).toBe("fault_latched");
  });

  test("what changes the force by nothing that is noticed is not why", () => {
    const asks = tick({ askedForce: 1.21 });
    expect(why(facts(["slew_cut", "pull_removed"], { tick: asks })).text).toContain("Stiffness");
    expect(why(facts(["slew_cut"])).link).toBe("slew_cut");
  });

  test("a fixture that gives a part of the force is named, also where all is limited", () => {
    const both = tick({ region: 2, askedForce: 5.3, force: [0, 0, 3.3] });
    const acting = ["keep off 1"];
    expect(why(facts(["force_cut"], { tick: both, acting })).text).toBe(
      "Limited to what is allowed; the surface and “keep off 1” asked for 5.3 N.",
    );
    expect(why(facts([], { tick: both, acting })).text).toMatch(/“keep off 1” gives a part of it/);
    const alone = { ...both, state: 0, askedForce: 2, force: [0, 0, 2] as Vec3 };
    expect(why(facts(["force_cut"], { tick: alone, acting }))).toMatchObject({
      word: "kept off",
      text: "“keep off 1” gives this force.",
    });
    const guided = { ...alone, region: 0, guidance: 2 };
    expect(why(facts([], { tick: guided, acting: ["a", "b"] }))).toMatchObject({
      word: "guided",
      text: "“a” and “b” give this force.",
    });
    expect(why(facts([], { tick: alone })).text).toContain("A fixture that is gone");
  });

  test("no force has its true reason: in the air, behind, nothing there, too sparse", () => {
    const said = (more: Partial<Facts>) => why(facts([], { tick: air, ...more }));
    expect(said({})).toMatchObject({ detail: "hand 30 mm above" });
    expect(said({ clearance: -0.03 })).toMatchObject({
      detail: "hand 30.0 mm behind",
      text: expect.stringContaining("behind what the camera sees"),
    });
    expect(said({ clearance: null }).text).toContain("nothing is seen under the hand");
    expect(said({ clearance: 0, spacing: 0.04 }).text).toContain("40 mm apart are too sparse");
    expect(said({ spacing: 0.04 }).text).toContain("in the air");
    expect(said({ tick: { ...air, frame: -1 } }).text).toContain("nothing to touch yet");
  });

  test("a hand that nobody holds, that is lost, or a program that is silent", () => {
    const free = why(facts(["disengaged"], { hand: "free", tick: none }));
    expect(free.text).toMatch(/nobody holds.*press/);
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

  test("no combination contradicts itself", () => {
    const flags = [
      ...["", "on_hold", "fault_latched", "output_refused", "input_refused", "direction_refused"],
      ...["no_frame", "non_finite_input", "frame_lost", "hand_too_fast", "stalled"],
      ...["disengaged", "ramping"],
      ...["free_space_released", "proxy_let_go", "frame_fading", "surface_hidden", "frame_late"],
      ...["returned_to_front", "pop_through_suspected", "energy_cut", "oscillation_cut"],
      ...["continuous_cut", "scale_unsure", "force_cut", "force_saturated", "pull_removed"],
      ...["slew_cut", "step_budget_hit", "frame_stale"],
    ];
    const each = function* () {
      for (const first of flags)
        for (const second of ["", "disengaged"])
          for (const state of [0, 1, 2])
            for (const force of [0, 1.2, 3.3])
              for (const [region, guidance] of [[0, 0], [2, 0], [0, 2], [2, 2]] as const)
                for (const askedForce of [0, 1.2, 5.3])
                  for (const clearance of [null, -0.03, 0.03])
                    for (const hand of ["you", "free"] as const)
                      yield [
                        { state, force, askedForce, region, guidance },
                        { first, second, clearance, hand },
                      ] as const;
    };
    let count = 0;
    for (const [
      { state, force, askedForce, region, guidance },
      { first, second, clearance, hand },
    ] of each()) {
      const acting = region + guidance > 0 ? ["fence"] : [];
      const now = tick({ state, force: [0, 0, force], region, guidance, askedForce });
      const input = { tick: now, acting, clearance, hand };
      const { word, detail, text, link } = why(facts([first, second], input));
      const wrong = [
        !/^[A-Z“][^.]*(\d\.\d[^.]*)*\.$/.test(text) && "not one sentence",
        text.startsWith("No force") !== (force === 0) && "force and words differ",
        /in the air/.test(text) && (state !== 0 || /inside|behind/.test(detail)) && "in the air",
        word === "free" && (state !== 0 || region > 0 || guidance > 0) && "not free",
        /inside|contact|entrenched/.test(`${word} ${detail}`) && state === 0 && "not in contact",
        link && ![first, second].includes(link) && "a flag that is not set",
        // Of one force there is one number; what was asked for is more, and is called that.
        [...text.matchAll(/([\d.]+) N\b(?!\/)/g)].some(
          ([, n]) => !(/asked for/.test(text) && +n! > force && +n! === askedForce),
        ) && "another number",
        /(gives|give|asked for)\b/.test(text) && region + guidance > 0 !== /fence/.test(text) &&
          "a fixture that is not named",
      ].filter(Boolean);
      if (wrong.length > 0)
        throw new Error(
          `${wrong}: ${JSON.stringify({ word, detail, text, first, second, ...input })}`,
        );
      ++count;
    }
    expect(count).toBeGreaterThan(30_000);
  }, 60_000); // [ms] 40,000 combinations take seconds on a slow machine; a hang takes longer
});

test("a line stays to be read, unless a graver one comes or it is no longer true", () => {
  const steady = new SteadyWhy();
  const [cut, plain, ramp] = [["slew_cut"], [], ["ramping"]].map((flags) => why(facts(flags)));
  expect(steady.show(plain!, 0)).toEqual(plain);
  expect(steady.show(cut!, 10)).toEqual(cut);
  expect(steady.show(plain!, 100)).toEqual(cut);
  expect(steady.show(ramp!, 110)).toEqual(ramp);
  expect(steady.show(plain!, 500)).toEqual(ramp);
  expect(steady.show(plain!, 700)).toEqual(plain);
  expect(steady.show(ramp!, 800)).toEqual(ramp);
  const free = why(facts([], { tick: air }));
  expect(steady.show(free, 810)).toEqual(free);
});
