// SPDX-License-Identifier: Apache-2.0
import { expect, it } from "vitest";

import { handsLines, handsText } from "../src/others";
import type { OtherHand } from "../src/protocol";

const left: OtherHand = {
  name: "left",
  hip: [0, 0, -0.01],
  proxy: [0, 0, 0],
  force: [0, 0, 2],
  touches: true,
  present: true,
  trouble: "",
};

it("says what each hand does, and what is wrong before anything else", () => {
  expect(handsText([left])).toBe("left touches with 2.0 N");
  expect(handsText([{ ...left, touches: false }])).toBe("left is free");
  expect(handsText([{ ...left, present: false }])).toBe("left: nobody holds it");
  expect(handsText([{ ...left, present: false, trouble: "its cable is out" }])).toBe(
    "left: its cable is out",
  );
  expect(handsText([left, { ...left, name: "hand_3", touches: false }])).toBe(
    "left touches with 2.0 N · hand_3 is free",
  );
});

it("draws a line from each HIP to its proxy, and one for the force where there is one", () => {
  expect(handsLines([left])).toEqual([0, 0, -0.01, 0, 0, 0, 0, 0, 0, 0, 0, 0.04]);
  expect(handsLines([{ ...left, force: [0, 0, 0] }])).toEqual([0, 0, -0.01, 0, 0, 0]);
  expect(handsLines([])).toEqual([]);
});
