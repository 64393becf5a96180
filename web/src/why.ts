// SPDX-License-Identifier: Apache-2.0
// Why the force is what it is, in one line, from the flags that the program sends.

import { dot, length, sub } from "./camera_math";
import type { Hello, State, Ticks } from "./protocol";

/** A sentence, and the name of the flag that decides; empty: none does. */
export interface Why {
  text: string;
  link: string;
  /** place in the order: the lower, the more it decides */
  rank: number;
}

/** What the line is made of. */
export interface Facts {
  connected: boolean;
  tick: Pick<
    Ticks,
    "state" | "hip" | "proxy" | "normal" | "gain" | "askedForce" | "force"
  > | null;
  /** names of the flags that are set */
  flags: ReadonlySet<string>;
  hand: "you" | "other" | "free";
  state: Pick<State, "latched_by" | "device" | "parameters"> | null;
}

/** Names of the bits that are set, in one of the program's tables. */
export function flagNames(bits: number, table: Hello["flags"]): string[] {
  return table.filter((_, i) => (bits & (1 << i)) !== 0).map(({ name }) => name);
}

/**
 * How deep the HIP is below the surface [m], negative above it: that surface is one contact radius
 * below the proxy, along the normal.
 */
export function depthBelow(tick: Pick<Ticks, "hip" | "proxy" | "normal">, r_c: number): number {
  const out = sub(tick.proxy, tick.hip);
  return (length(tick.normal) > 0.5 ? dot(out, tick.normal) : length(out)) - r_c;
}

const newtons = (value: number) => `${value.toFixed(1)} N`;

// In the order in which they decide. Empty: this does not say why.
const RULES: readonly [flag: string, say: (facts: Facts) => string][] = [
  [
    "fault_latched",
    ({ state }) =>
      `No force: faults came again and again (${(state?.latched_by ?? []).join(", ")}); ` +
      "the operator resets them.",
  ],
  ["output_refused", () => "No force: the safety chain's own result broke its bounds."],
  ["input_refused", () => "No force: the hand or the method gave a number that is not finite."],
  ["direction_refused", () => "No force: the surface normal contradicts the force's direction."],
  ["non_finite_input", () => "No force: the hand's place is not finite."],
  ["no_frame", () => "No force: there is no frame to touch yet."],
  ["frame_lost", () => "No force: a camera has sent no usable frame for too long."],
  ["hand_too_fast", () => "No force: the hand was faster than it may be."],
  ["stalled", () => "The force starts again from nothing: the loop missed its deadlines."],
  ["disengaged", disengaged],
  ["free_space_released", () => "No force: the camera sees free space around the hand."],
  ["proxy_let_go", () => "No force: the proxy was too far from the hand and starts anew there."],
  ["frame_fading", () => "Fading: a camera's newest frame is old."],
  ["surface_hidden", ({ tick }) => (touches(tick) ? "Held: something hides the surface." : "")],
  [
    "ramping",
    ({ tick }) =>
      touches(tick) ? `Rising gently: ${Math.round(100 * (tick?.gain ?? 0))} % so far.` : "",
  ],
  ["returned_to_front", () => "Rising: the proxy was behind the surface and was brought back."],
  ["pop_through_suspected", () => "In doubt: the proxy may be behind the surface."],
  ["frame_late", () => "May only fall: a camera's next frame is overdue."],
  ["energy_cut", () => "Softened: the surface kept up an oscillation."],
  ["oscillation_cut", () => "Softened: the force swung fast, again and again."],
  ["continuous_cut", ({ tick }) => `Limited: the motors are warm; ${asked(tick)}`],
  ["force_cut", ({ tick }) => `Limited to what is allowed; ${asked(tick)}`],
  ["force_saturated", () => "Limited by the method's max force."],
  [
    "pull_removed",
    ({ tick }) => (differs(tick) ? "The part that pulled into the surface is removed." : ""),
  ],
  [
    "correction_cut",
    ({ tick }) => (differs(tick) ? "Coming slowly: the surface was corrected under the hand." : ""),
  ],
  ["slew_cut", ({ tick }) => (differs(tick) ? "Changing as fast as it may." : "")],
];

// Does the force that is sent differ from what the method asks for, so that somebody could notice?
function differs(tick: Facts["tick"]): boolean {
  if (!tick) return false;
  const sent = length(tick.force);
  return Math.abs(sent - tick.askedForce) > Math.max(0.02, 0.05 * tick.askedForce);
}

function touches(tick: Facts["tick"]): boolean {
  return tick !== null && tick.state !== 0;
}

function asked(tick: Facts["tick"]): string {
  return `the method asks for ${newtons(tick?.askedForce ?? 0)}.`;
}

function disengaged({ tick, hand, state }: Facts): string {
  if (state?.device.takes_hand && hand === "free")
    return "No force: nobody holds the hand. Press on the surface.";
  if (touches(tick)) return "No force yet: pull back, then push in again.";
  return "";
}

/** The one line. */
export function why(facts: Facts): Why {
  const { tick, state, flags } = facts;
  if (!facts.connected) return { text: "No word from the program.", link: "", rank: -3 };
  if (!tick) return { text: "No tick yet.", link: "", rank: -2 };
  const fault = state?.device.fault;
  if (fault) return { text: `The hand is lost: ${fault}`, link: "hand", rank: -1 };
  for (const [rank, [link, say]] of RULES.entries()) {
    const text = flags.has(link) ? say(facts) : "";
    if (text) return { text, link, rank };
  }
  const stiffness = state?.parameters.stiffness ?? 0;
  const depth = depthBelow(tick, state?.parameters.r_c ?? 0);
  const text = !touches(tick)
    ? "No force: the hand is in the air."
    : depth > 0
      ? `Stiffness ${stiffness.toFixed(0)} N/m times ${(1e3 * depth).toFixed(1)} mm.`
      : "No force yet: the sphere touches, the hand is still above the surface.";
  return { text, link: "", rank: RULES.length };
}

const PATIENCE = 500; // [ms]

/** Keeps a line long enough to be read, unless one comes that decides more. */
export class SteadyWhy {
  private shown: Why | null = null;
  private seen = 0;

  show(newest: Why, now: number): Why {
    const same = this.shown?.link === newest.link && this.shown.rank === newest.rank;
    if (same || !this.shown || newest.rank < this.shown.rank || now - this.seen > PATIENCE) {
      this.shown = newest;
      this.seen = now;
    }
    return this.shown;
  }
}
