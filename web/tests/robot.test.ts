// SPDX-License-Identifier: Apache-2.0
import { expect, it } from "vitest";

import type { RobotState } from "../src/protocol";
import { robotLines, robotText } from "../src/others";

const led: RobotState = {
  name: "robot",
  tool: [0.1, 0, 0.2],
  links: [
    [0, 0, 0],
    [0, 0, 0.3],
    [0.1, 0, 0.2],
  ],
  force: [0, 0, 0],
  radius: 0.005,
  age: 0.01,
  latency: 0.12,
  led: true,
  trouble: "",
};

it("says what a robot does, and what is wrong before anything else", () => {
  expect(robotText(led)).toBe("robot follows commands · the rendered image is 120 ms old");
  expect(robotText({ ...led, force: [0, 0, 2] })).toContain("2.0 N");
  expect(robotText({ ...led, led: false })).toContain("no operator commands");
  expect(robotText({ ...led, age: 2 })).toContain("2.0 s ago");
  expect(robotText({ ...led, tool: null })).toContain("not been heard");
  expect(robotText({ ...led, age: 2, trouble: "its emergency stop is open" })).toBe(
    "robot: its emergency stop is open",
  );
});

it("draws the force from the tip on", () => {
  expect(robotLines(led)).toEqual([]);
  const pushed = robotLines({ ...led, force: [0, 0, 5] });
  expect(pushed.slice(0, 3)).toEqual([0.1, 0, 0.2]);
  expect(pushed[5]).toBeCloseTo(0.3);
  expect(robotLines({ ...led, tool: null, force: [0, 0, 5] })).toEqual([]);
});
