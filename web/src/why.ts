// SPDX-License-Identifier: Apache-2.0
// What the hand feels and why: two words and one sentence, all from one state of the program.

import { dot, length, sub } from "./camera_math";
import type { State, Ticks } from "./protocol";

/** What is said of the force. No part contradicts another, nor the newtons beside it. */
export interface Why {
  word: string; // what the hand does: free, kept off, guided, contact, entrenched
  detail: string; // how far it is from the surface; empty: that is not known
  /** one sentence, which begins with "No force" where a connected program sends none, only there */
  text: string;
  link: string; // the flag that decides; empty: none does
  rank: number; // place in the order: the lower, the more it decides
}

type Unsaid =
  | ("kind" | "samples" | "t" | "steps")
  | ("orientation" | "proxyOrientation" | "torque" | "contacts");

/** What it is made of. */
export interface Facts {
  connected: boolean;
  tick: Omit<Ticks, Unsaid> | null;
  flags: ReadonlySet<string>; // names of the flags that are set
  hand: "you" | "other" | "free";
  state: Pick<State, "device" | "parameters" | "tool"> | null;
  acting: readonly string[]; // names of the fixtures that give a force
  /** [m] of the proxy above what is seen, below 0 behind it; null: nothing is seen there */
  clearance: number | null;
  spacing: number | null; // [m] between what is measured about the hand; null: not known
}

/** Names of the bits that are set, in one of the program's tables. */
export function flagNames(bits: number, table: readonly { name: string }[]): string[] {
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

/** [m] between the proxy and what it touches: a tool touches with its own surface. */
export function contactRadius(state: Facts["state"]): number {
  return state && state.tool === "ball" ? (state.parameters.r_c ?? 0) : 0;
}

const LEAST_FORCE = 0.005; // [N] less is written as 0.00
const BEHIND = 0.002; // [m] below what is seen: less is noise
const ALIKE = 0.1; // [-] by which the stiffness that acts may differ from the one that is set

type Tick = NonNullable<Facts["tick"]>;
type Say = (facts: Facts & { tick: Tick }) => string;

const sent = ({ force }: Tick) => length(force);
const isLeft = ({ state, hand }: Pick<Facts, "state" | "hand">) =>
  state?.device.takes_hand === true && hand === "free";
const touches = ({ state }: Tick) => state !== 0;
const newtons = (value: number, digits = 1) => `${value.toFixed(digits)} N`;
const millimetres = (metres: number) => (1e3 * metres).toFixed(metres < 0.01 ? 1 : 0);

// Is the force that is sent another than what is asked for, so that somebody could notice, or less?
const changes = ({ askedForce, force }: Tick) =>
  Math.abs(askedForce - length(force)) > Math.max(0.02, 0.05 * askedForce);
const falls = (tick: Tick) => tick.askedForce > sent(tick) && changes(tick);

function fixtures({ tick, acting }: Parameters<Say>[0]): string {
  if (Math.max(tick.region, tick.guidance) < LEAST_FORCE) return "";
  return acting.map((name) => `“${name}”`).join(" and ") || "a fixture that is gone";
}

function asked(facts: Parameters<Say>[0]): string {
  const { tick } = facts;
  const askers = [touches(tick) ? "the surface" : "", fixtures(facts)].filter(Boolean);
  return `${askers.join(" and ") || "the method"} asked for ${newtons(tick.askedForce)}.`;
}

// Of a limit that makes the force that is sent less than what is asked for.
const limited =
  (how: string): Say =>
  (facts) =>
    falls(facts.tick) ? `${how}; ${asked(facts)}` : "";

// Why no force is sent, in the order in which they decide. Empty: this does not say why.
const NONE: readonly [flag: string, say: Say][] = [
  ["on_hold", () => "the operator has put it on hold."],
  ["fault_latched", () => "faults came again and again, and the operator has to reset them."],
  ["output_refused", () => "the safety chain's own result broke its bounds."],
  ["input_refused", () => "the hand or the method gave a number that is not finite."],
  ["direction_refused", () => "the surface normal contradicts the force's direction."],
  ["non_finite_input", () => "the hand's place is not finite."],
  ["no_frame", () => "there is no frame to touch yet."],
  ["frame_lost", () => "a camera has sent no usable frame for too long."],
  ["hand_too_fast", () => "the hand moved faster than max_speed."],
  [
    "disengaged",
    (facts) => (touches(facts.tick) && !isLeft(facts) ? "pull back, then push in again." : ""),
  ],
  ["free_space_released", () => "the camera sees free space around the hand."],
  ["proxy_let_go", () => "the proxy was too far from the hand and was reset to it."],
];

// What changes a force that is asked for, likewise.
const LESS: readonly [flag: string, say: Say][] = [
  ["stalled", () => "Starting again from nothing, as the loop missed its deadlines."],
  ["frame_fading", () => "Fading, as a camera's newest frame is old."],
  ["surface_hidden", ({ tick }) => (touches(tick) ? "Held, as something hides the surface." : "")],
  ["ramping", ({ tick }) => `Rising gently, ${Math.round(100 * tick.gain)} % so far.`],
  ["returned_to_front", () => "Rising, as the proxy was behind the surface and was brought back."],
  ["pop_through_suspected", () => "In doubt, as the proxy may be behind the surface."],
  ["frame_late", () => "It may only fall, as a camera's next frame is overdue."],
  ["energy_cut", () => "Softened, as the surface kept up an oscillation."],
  ["oscillation_cut", () => "Softened, as the force swung fast, again and again."],
  ["continuous_cut", limited("Limited, as the motors are warm")],
  ["scale_unsure", limited("Limited, as the scale of the depth is in doubt")],
  ["force_cut", limited("Limited to what is allowed")],
  ["force_saturated", ({ tick }) => (touches(tick) ? "Limited by the method's max force." : "")],
  [
    "pull_removed",
    ({ tick }) =>
      changes(tick) ? "Reduced: the part that pulled into the surface was removed." : "",
  ],
  ["slew_cut", ({ tick }) => (changes(tick) ? "Changing as fast as it may." : "")],
];

// Nothing is sent, and no flag says why.
function noForce({ tick, state, hand, clearance, spacing }: Parameters<Say>[0]): string {
  const r_c = contactRadius(state);
  if (isLeft({ state, hand }))
    return "nobody holds the hand; press on the surface to touch it.";
  if (touches(tick))
    return depthBelow(tick, r_c) > 0
      ? "the surface asks for none here."
      : "the proxy touches, the hand is still above the surface.";
  if (tick.frame < 0) return "there is nothing to touch yet.";
  if (spacing !== null && r_c > 0 && spacing > r_c && (clearance ?? 0) < r_c)
    return (
      `points ${millimetres(spacing)} mm apart are too sparse for a sphere of ` +
      `${millimetres(2 * r_c)} mm.`
    );
  if (clearance === null) return "nothing is seen under the hand.";
  return clearance < -BEHIND
    ? "the hand is behind what the camera sees; pull it out and press again."
    : "the hand is in the air.";
}

// A force is sent, and no flag changes it.
function plainForce(facts: Parameters<Say>[0]): string {
  const { tick, state } = facts;
  const who = fixtures(facts);
  if (who) {
    const verb = facts.acting.length > 1 ? "give" : "gives";
    return touches(tick)
      ? `${capital(who)} ${verb} a part of it, and the surface the rest.`
      : `${capital(who)} ${verb} this force.`;
  }
  if (!touches(tick)) return "Fading, as the contact has ended.";
  const depth = depthBelow(tick, contactRadius(state));
  if (depth <= 0) return "Fading, as the hand is out of the surface.";
  const set = state?.parameters.stiffness ?? 0;
  const acts = sent(tick) / depth;
  const shown = Math.abs(acts - set) <= ALIKE * set ? set : Number(acts.toPrecision(2));
  return `Stiffness ${shown.toFixed(0)} N/m times ${(1e3 * depth).toFixed(1)} mm.`;
}

const capital = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);
const small = (text: string) => text.charAt(0).toLowerCase() + text.slice(1);

function said(
  rules: readonly [string, Say][],
  facts: Parameters<Say>[0],
  first: number,
): Pick<Why, "text" | "link" | "rank"> | null {
  for (const [i, [link, say]] of rules.entries()) {
    const text = facts.flags.has(link) ? say(facts) : "";
    if (text) return { text, link, rank: first + i };
  }
  return null;
}

function sentence(facts: Facts & { tick: Tick }): Pick<Why, "text" | "link" | "rank"> {
  const { tick, flags } = facts;
  const fault = facts.state?.device.fault;
  if (fault) return { text: `No force: the hand is lost: ${fault}`, link: "hand", rank: -1 };
  const plain = { link: "", rank: NONE.length + LESS.length };
  if (sent(tick) >= LEAST_FORCE)
    return said(LESS, facts, NONE.length) ?? { text: plainForce(facts), ...plain };
  // A flag of some ticks ago says nothing of a hand that is where no force is asked for.
  const less = tick.askedForce >= LEAST_FORCE ? said(LESS, facts, NONE.length) : null;
  const none = said(NONE, facts, 0);
  if (none) return { ...none, text: `No force: ${none.text}` };
  if (less) return { ...less, text: `No force yet: ${small(less.text)}` };
  return {
    text: `No force: ${noForce(facts)}`,
    ...(flags.has("disengaged") ? { ...plain, link: "disengaged" } : plain),
  };
}

/** The one word, the one distance and the one sentence. */
export function why(facts: Facts): Why {
  const nothing = { word: "", detail: "", link: "" };
  if (!facts.connected) return { ...nothing, text: "No word from the program.", rank: -3 };
  const { tick, clearance, state } = facts;
  if (!tick) return { ...nothing, text: "No tick yet.", rank: -2 };
  const height = touches(tick) ? -depthBelow(tick, contactRadius(state)) : clearance;
  const inside = touches(tick) ? "inside" : "behind";
  const isIn = height !== null && height < (touches(tick) ? 0 : -BEHIND);
  return {
    ...sentence({ ...facts, tick }),
    word: touches(tick)
      ? (["", "contact", "entrenched"][tick.state] ?? "contact")
      : tick.region >= LEAST_FORCE
        ? "kept off"
        : tick.guidance >= LEAST_FORCE
          ? "guided"
          : "free",
    detail:
      height === null
        ? ""
        : isIn
          ? `hand ${(-1e3 * height).toFixed(1)} mm ${inside}`
          : `hand ${millimetres(Math.max(height, 0))} mm above`,
  };
}

const PATIENCE = 500; // [ms]

/**
 * Keeps a sentence long enough to be read, unless one comes that decides more, or the hand does
 * something else: then what was said is no longer true.
 */
export class SteadyWhy {
  private shown: Why | null = null;
  private seen = 0;

  show(newest: Why, now: number): Why {
    const { shown } = this;
    const isNone = ({ text }: Why) => text.startsWith("No force");
    const isStill =
      shown !== null && shown.word === newest.word && isNone(shown) === isNone(newest);
    const same = shown?.link === newest.link && shown.rank === newest.rank;
    if (same || !isStill || newest.rank < shown.rank || now - this.seen > PATIENCE) {
      this.shown = newest;
      this.seen = now;
    }
    return { ...this.shown!, detail: newest.detail };
  }
}
