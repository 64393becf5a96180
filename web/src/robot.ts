// SPDX-License-Identifier: Apache-2.0
// A robot that the hand leads: what is said of it, and where its force goes.

import { add, length, scale } from "./camera_math";
import type { RobotState } from "./protocol";

const ARROW = 0.02; // [m] of a line for each N that the tool presses with
const SILENCE = 0.5; // [s] after which what was heard last is old

/** One line: what it does, how old the rendered image is, how hard it presses. */
export function robotText({ name, tool, trouble, led, age, latency, force }: RobotState): string {
  if (trouble) return `${name}: ${trouble}`;
  if (!tool) return `${name} has not been heard yet`;
  if (age > SILENCE) return `the last message of ${name} came ${age.toFixed(1)} s ago`;
  const parts = [led ? `${name} follows commands` : `${name} is at rest: no operator commands it`];
  if (latency > 0) parts.push(`the rendered image is ${(1e3 * latency).toFixed(0)} ms old`);
  const newtons = length(force);
  if (newtons > 0.05) parts.push(`its tool is pushed with ${newtons.toFixed(1)} N`);
  return parts.join(" · ");
}

/** The force on its tool as a line: its ends, x y z after one another. */
export function robotLines({ tool, force }: Pick<RobotState, "tool" | "force">): number[] {
  return tool && length(force) > 0 ? [...tool, ...add(tool, scale(force, ARROW))] : [];
}
