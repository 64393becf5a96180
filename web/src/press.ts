// SPDX-License-Identifier: Apache-2.0
// The way of a hand that presses where somebody points: over to the spot, down to it, into it until
// it pushes with some force, and along the surface when the spot moves. Never a jump.

import { add, approach, clamp, dot, length, scale, sub, unit } from "./camera_math";
import type { Vec3 } from "./protocol";
import type { Spot } from "./surface";

/** [m] above the surface: where a hand waits before it presses, and after. */
export const HOVER = 0.025;
/** [m/s] through the air; the mouse device itself is held to 1 m/s. */
export const TRAVEL = 0.6;
/** [m/s] along a surface that is touched. */
export const SLIDE = 0.3;
/** [m] that a hand in the air flies after what frames show where the pointer rests. */
export const LONGEST_CHASE = 2;

const PRESS_FORCE = 2; // [N] that a press settles at: clear, and within a small device's 3.3 N
const DEPTHS = [0.0015, 0.015] as const; // [m] least and most that it takes for that
const DEEPEST = 0.03; // [m] that the hand looks for a surface behind where it was seen
const GAIN = 5; // [1/s] of the depth that is missing; ticks are known 50 ms late
const PUSH = 0.03; // [m/s] fastest into what is touched
const PULL = 0.1; // [m/s] fastest out of it: what comes towards the hand pushes it away
const AIR_GAIN = 8; // [1/s] of the height
const DESCENT = 0.15; // [m/s] fastest towards the surface
const SEEK = 0.015; // [m/s] on, where the surface should have been met
const JUMP = 0.08; // [m] a spot that is farther from the last is flown to, not slid to
const WAIT = -0.001; // [m] depth at which a hand waits to be engaged: it is asked to feel nothing
const SLACK = 0.02; // [m] by which the hand may be ahead of its proxy, besides the depth
const CLEAR = 0.015; // [m] before all that is seen, on a flight
const SETTLE = 0.2; // of what a new frame says of the spot of a hand that touches
const BEHIND = 0.01; // [m] behind what is seen, where the surface should have been met
const PATIENCE = 0.25; // [s] there without a contact, after which the hand begins again
const LONGEST_STEP = 0.05; // [s] a page that was busy makes no larger step

/** What the newest tick says. */
export interface Felt {
  touching: boolean;
  engaged: boolean; // the safety chain lets forces through, or begins to
  hip: Vec3;
  proxy: Vec3;
  normal: Vec3; // zero: none
}

/**
 * How far a place is before the surface along a camera's sightline [m], negative behind it, and the
 * unit vector to the camera; null where nothing is seen.
 */
export type Ahead = (place: Vec3) => { distance: number; towards: Vec3 } | null;

/** Where a hand hovers over a spot. */
export function above(spot: Spot, hover = HOVER): Vec3 {
  return add(spot.at, scale(spot.normal, hover));
}

/**
 * A way through seen free space: straight if nothing is in between, else lifted towards the camera
 * over what is, at each end by what is needed there. What a camera sees past is free.
 */
export function flight(from: Vec3, to: Vec3, ahead: Ahead): Vec3[] {
  const samples = 24;
  const rounds = 12;
  const towards = ahead(to)?.towards ?? ahead(from)?.towards ?? null;
  if (!towards) return [to];
  const ends: [Vec3, Vec3] = [from, to];
  let isLifted = false;
  for (let round = 0; round < rounds; ++round) {
    let [missing, share] = [0, 0]; // [m] where the way comes nearest to what is seen
    for (let i = 0; i <= samples; ++i) {
      const t = i / samples;
      const seen = ahead(add(scale(ends[0], 1 - t), scale(ends[1], t)));
      if (seen && CLEAR - seen.distance > missing) [missing, share] = [CLEAR - seen.distance, t];
    }
    if (missing < 1e-6) break;
    isLifted = true;
    // The end that is nearer to that place rises most: a way that is planned anew with each frame,
    // to what hides behind something, must not climb at its beginning each time.
    const shares = [1 - share, share] as const;
    const part = missing / (shares[0] ** 4 + shares[1] ** 4);
    shares.forEach((of, end) => (ends[end] = add(ends[end]!, scale(towards, part * of ** 3))));
  }
  return isLifted ? [...ends, to] : [to];
}

export class Press {
  private place: Vec3;
  private way: Vec3[];
  private readonly hover: number; // [m] above the surface
  private depth: number; // [m] of the hand below the spot's plane
  private wanted: number; // [m] depth below the surface that is felt; negative: above it
  private touching = false;
  private chased = 0; // [m] that frames have led the hand since the pointer moved
  private missed = 0; // [s] behind what is seen, without a contact
  private readonly isSeen: boolean; // some camera has an image of where it presses

  /**
   * @param start  [m] where the hand is
   * @param spot   where it is to press
   * @param hand   its contact radius [m], the stiffness of the coupling [N/m], and how far a tool
   *               reaches from it [m]
   */
  constructor(
    start: Vec3,
    private spot: Spot,
    private readonly hand: { r_c: number; stiffness: number; reach?: number },
    private readonly ahead: Ahead,
  ) {
    this.place = start;
    this.hover = HOVER + (hand.reach ?? 0);
    this.depth = -this.hover;
    this.way = flight(start, above(spot, this.hover), ahead);
    this.isSeen = ahead(spot.at) !== null;
    this.wanted = clamp(PRESS_FORCE / Math.max(hand.stiffness, 1), ...DEPTHS);
  }

  get travelling(): boolean {
    return this.way.length > 0;
  }

  get aimedAt(): Spot {
    return this.spot;
  }

  /** A hand in the air goes wherever its pixel's surface is; one that touches stays there. */
  get inAir(): boolean {
    return !this.touching;
  }

  /** The pointer moved: slides there, or flies where it is far. */
  aim(spot: Spot): void {
    this.chased = 0;
    this.go(spot);
  }

  private go(spot: Spot): void {
    const away = length(sub(spot.at, this.spot.at));
    this.spot = spot;
    if (this.travelling || away >= JUMP) this.beginAgain();
  }

  private beginAgain(): void {
    this.missed = 0;
    this.depth = -this.hover;
    this.way = flight(this.place, above(this.spot, this.hover), this.ahead);
  }

  /** The pointer rests, and a new frame says where its spot is: follows, in contact calmly. */
  follow(spot: Spot): void {
    const away = sub(spot.at, this.spot.at);
    if (this.inAir && this.chased + length(away) <= LONGEST_CHASE) {
      if (length(away) > JUMP) this.chased += length(away);
      return this.go(spot);
    }
    if (length(away) > JUMP) return; // something has come between
    this.spot = {
      at: add(this.spot.at, scale(away, SETTLE)),
      normal: unit(add(scale(this.spot.normal, 1 - SETTLE), scale(spot.normal, SETTLE))),
    };
  }

  /** Presses deeper by so much [m], or less deep. */
  refine(metres: number): void {
    this.wanted = clamp(this.wanted + metres, -HOVER, DEEPEST);
  }

  /** Where the hand is to be, `seconds` after the last call. */
  step(seconds: number, felt: Felt | null): Vec3 {
    const dt = clamp(seconds, 0, LONGEST_STEP);
    this.touching = felt?.touching ?? false;
    const isBehind = (this.ahead(this.place)?.distance ?? 0) < -BEHIND;
    this.missed = isBehind && this.inAir ? this.missed + dt : 0;
    if (this.missed > PATIENCE && !this.travelling) this.beginAgain();
    if (this.travelling) {
      let left = TRAVEL * dt;
      while (left > 0 && this.way.length > 0) {
        const next = approach(this.place, this.way[0]!, left);
        left -= length(sub(next, this.place));
        this.place = next;
        if (length(sub(next, this.way[0]!)) > 1e-9) break;
        this.way.shift();
      }
      return this.place;
    }
    this.depth = clamp(this.depth + this.rate(felt) * dt, -this.hover, DEEPEST);
    let goal = sub(this.spot.at, scale(this.spot.normal, this.depth));
    if (felt?.touching) goal = this.nearProxy(goal, felt.proxy);
    this.place = approach(this.place, goal, (felt?.touching ? SLIDE : TRAVEL) * dt);
    return this.place;
  }

  /** Where the hand goes when it is let go: out of what it touches, or above the spot. */
  retreat(felt: Felt | null): Vec3 {
    return (!this.travelling && felt && outOf(felt)) || above(this.spot, this.hover);
  }

  // A hand that slides does not run away from its proxy; how deep it is, is not touched by that.
  private nearProxy(goal: Vec3, proxy: Vec3): Vec3 {
    const away = sub(goal, proxy);
    const out = dot(away, this.spot.normal);
    const aside = sub(away, scale(this.spot.normal, out));
    const reach = this.hand.r_c + Math.max(this.wanted, 0) + SLACK;
    const height = scale(this.spot.normal, clamp(out, -reach, reach));
    return add(add(proxy, height), approach([0, 0, 0], aside, SLACK));
  }

  // [m/s] into the surface.
  private rate(felt: Felt | null): number {
    if (felt?.touching) {
      // The surface that is felt is one contact radius below the proxy.
      const feltDepth = length(sub(felt.proxy, felt.hip)) - this.hand.r_c;
      // A hand that is disengaged in a surface, as after silence, would stay so.
      const wanted = felt.engaged ? this.wanted : Math.min(this.wanted, WAIT);
      return clamp(GAIN * (wanted - feltDepth), -PULL, PUSH);
    }
    // Out of the image, or in a hole of it, the hand waits: what comes there must meet it outside.
    const wanted = this.isSeen && !this.ahead(this.spot.at) ? -this.hover : this.wanted;
    const rate = clamp(AIR_GAIN * (wanted - this.depth), -PULL, DESCENT);
    return wanted > 0 ? Math.max(rate, SEEK) : rate;
  }
}

/** Where a hand hovers that leaves what it touches; null: it touches nothing. */
export function outOf(felt: Felt): Vec3 | null {
  if (!felt.touching) return null;
  const out = length(felt.normal) > 0.5 ? felt.normal : unit(sub(felt.proxy, felt.hip));
  return add(felt.proxy, scale(out, HOVER));
}
