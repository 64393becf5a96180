// SPDX-License-Identifier: Apache-2.0
// A press in a small world: a plane, a hand that goes where it is sent with the mouse's lag, and
// ticks that are known late.

import { describe, expect, test } from "vitest";
import { add, approach, dot, length, scale, sub } from "../src/camera_math";
import {
  above,
  flight,
  HOVER,
  LONGEST_CHASE,
  outOf,
  Press,
  SLIDE,
  TRAVEL,
  type Ahead,
  type Felt,
} from "../src/press";
import type { Vec3 } from "../src/protocol";
import { SeenSurface, type Spot } from "../src/surface";
import { block, both, plane, seen } from "./scene";

const r_c = 0.005;
const stiffness = 600; // [N/m]
const STEP = 0.016; // [s]
const LATE = 3; // steps, by which ticks are known late
const up: Vec3 = [0, 0, 1];
const floor = (x: number, y = 0): Spot => ({ at: [x, y, 0], normal: up });
const overFloor: Ahead = (place) => ({ distance: place[2], towards: up });

/** The plane z = height(t), on which a proxy rests, and what pages know of it. */
class World {
  t = 0;
  private hip: Vec3;
  private readonly known: Felt[] = [];
  engaged = true;
  readonly path: Vec3[] = [];

  constructor(
    start: Vec3,
    private readonly height: (t: number) => number = () => 0,
  ) {
    this.hip = start;
  }

  feel(): Felt {
    const rest = this.height(this.t) + r_c;
    const touching = this.hip[2] < rest;
    const proxy: Vec3 = touching ? [this.hip[0], this.hip[1], rest] : this.hip;
    const { hip, engaged } = this;
    return { touching, engaged, hip, proxy, normal: touching ? up : [0, 0, 0] };
  }

  get surface(): number {
    return this.height(this.t);
  }

  get force(): number {
    const { hip, proxy } = this.feel();
    return stiffness * Math.max(0, length(sub(proxy, hip)) - r_c);
  }

  /** Runs a press for some time. */
  run(press: Press, seconds: number, step = STEP): void {
    for (const end = this.t + seconds; this.t < end; this.t += step) {
      this.known.push(this.feel());
      const felt = this.known[Math.max(0, this.known.length - 1 - LATE)]!;
      const target = press.step(step, felt);
      this.path.push(target);
      // The mouse lags by 25 ms.
      this.hip = add(this.hip, scale(sub(target, this.hip), 1 - Math.exp(-step / 0.025)));
    }
  }
}

const speeds = (path: readonly Vec3[], step = STEP) =>
  path.slice(1).map((place, i) => length(sub(place, path[i]!)) / step);

test("a press goes over the spot, down to it, and comes to rest at two newtons", () => {
  const start: Vec3 = [0.1, 0.05, 0.05];
  const world = new World(start);
  const press = new Press(start, floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 1.5);
  const first = world.path.findIndex(([, , z]) => z < HOVER - 1e-6);
  expect(world.path[first]![0]).toBeCloseTo(0, 9); // not before it is above the spot
  expect(world.path[first]![1]).toBeCloseTo(0, 9);
  expect(world.force).toBeGreaterThan(1.7);
  expect(world.force).toBeLessThan(2.3);
  world.run(press, 3);
  expect(world.force).toBeCloseTo(2, 2);
  expect(Math.max(...speeds(world.path))).toBeLessThanOrEqual(TRAVEL * 1.0001);
});

test.each([0.004, -0.004])(
  "finds its force where the surface is %f m above what was seen",
  (error) => {
    const world = new World([0, 0, 0.05], () => error);
    const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
    let most = 0;
    for (let i = 0; i < 200; ++i) {
      world.run(press, STEP);
      most = Math.max(most, world.force);
    }
    expect(world.force).toBeCloseTo(2, 1);
    expect(most).toBeLessThan(3.3);
  },
);

test("does not look for a surface that is not there without end", () => {
  const world = new World([0, 0, 0.05], () => -1);
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 10);
  expect(world.path.at(-1)![2]).toBeGreaterThan(-0.031);
});

test("a surface that comes towards the hand pushes it away", () => {
  const world = new World([0, 0, 0.05], (t) => (t > 2 ? 0.05 * (t - 2) : 0));
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 2);
  let most = 0;
  for (let i = 0; i < 60; ++i) {
    // Every other step is a frame.
    if (i % 2 === 0) press.follow({ at: [0, 0, world.surface], normal: up });
    world.run(press, STEP);
    most = Math.max(most, world.force);
  }
  expect(most).toBeLessThan(7); // of the motion alone there would be 29 N
});

test("a hand that the safety chain has disengaged comes out until it may push again", () => {
  const world = new World([0, 0, 0.05]);
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 3);
  world.engaged = false;
  world.run(press, 2);
  expect(world.force).toBe(0); // what the method asks for: so the chain engages it
  expect(world.feel().touching).toBe(true);
  world.engaged = true;
  world.run(press, 2);
  expect(world.force).toBeCloseTo(2, 1);
});

test("the wheel presses deeper, less deep, and lifts off", () => {
  const world = new World([0, 0, 0.05]);
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 3);
  press.refine(0.002);
  world.run(press, 3);
  expect(world.force).toBeCloseTo(2 + 0.002 * stiffness, 1);
  press.refine(-0.004);
  world.run(press, 3);
  expect(world.force).toBeCloseTo(2 - 0.002 * stiffness, 1);
  press.refine(-1);
  world.run(press, 3);
  expect(world.force).toBe(0);
  expect(world.feel().hip[2]).toBeCloseTo(HOVER, 3);
});

test("a drag slides: contact holds, and the hand is no faster than it may be", () => {
  const world = new World([0, 0, 0.05]);
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 2);
  world.path.length = 0;
  const forces: number[] = [];
  for (let i = 1; i <= 100; ++i) {
    press.aim(floor(0.003 * i));
    world.run(press, STEP);
    forces.push(world.force);
  }
  world.run(press, 1);
  expect(world.feel().hip[0]).toBeCloseTo(0.3, 3);
  expect(Math.min(...forces)).toBeGreaterThan(1.5);
  expect(Math.max(...forces)).toBeLessThan(2.5);
  expect(Math.max(...speeds(world.path))).toBeLessThanOrEqual(SLIDE * 1.0001);
});

test("a quick drag keeps the force, however far the pointer is ahead", () => {
  const world = new World([0, 0, 0.05]);
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 2);
  const forces: number[] = [];
  for (let i = 1; i <= 20; ++i) press.aim(floor(0.03 * i)); // 0.6 m, each less than a flight
  while (world.feel().hip[0] < 0.59) {
    world.run(press, STEP);
    forces.push(world.force);
    expect(forces.length).toBeLessThan(500);
  }
  world.run(press, 1);
  expect(Math.min(...forces)).toBeGreaterThan(1.4);
  expect(Math.max(...forces, world.force)).toBeLessThan(2.6);
});

test("a spot far off is flown to, without a contact on the way", () => {
  const world = new World([0, 0, 0.05]);
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 2);
  press.aim(floor(0.4));
  expect(press.travelling).toBe(true);
  let lowest = 1;
  let touched = 0;
  while (press.travelling) {
    world.run(press, STEP);
    const { hip, touching } = world.feel();
    if (hip[0] > 0.1) lowest = Math.min(lowest, hip[2]);
    if (hip[0] > 0.1 && touching) ++touched;
  }
  expect(touched).toBe(0);
  expect(lowest).toBeGreaterThan(0.01);
  world.run(press, 3);
  expect(world.force).toBeCloseTo(2, 1);
});

test("a page that was busy makes no jump", () => {
  const world = new World([0, 0, 0.05]);
  const press = new Press([0, 0, 0.05], floor(0.3), { r_c, stiffness }, overFloor);
  const before = press.step(STEP, world.feel());
  const after = press.step(3, world.feel());
  expect(length(sub(after, before))).toBeLessThanOrEqual(TRAVEL * 0.05 + 1e-9);
  expect(press.step(-1, world.feel())).toEqual(after);
});

test("whatever spots it is aimed at, the hand is never faster than it may be", () => {
  let seed = 5;
  const random = () => (seed = (Math.imul(seed, 48271) >>> 0) % 2147483647) / 2147483647;
  const world = new World([0, 0, 0.1]);
  const press = new Press([0, 0, 0.1], floor(0), { r_c, stiffness }, overFloor);
  for (let i = 0; i < 400; ++i) {
    const tilt = 0.6 * (random() - 0.5);
    const normal: Vec3 = [Math.sin(tilt), 0, Math.cos(tilt)];
    const at: Vec3 = [random() - 0.5, random() - 0.5, 0.02 * random()];
    if (random() < 0.3) press.aim({ at, normal });
    else if (random() < 0.5) press.follow({ at, normal });
    else press.refine(0.02 * (random() - 0.5));
    world.run(press, 5 * STEP * random());
  }
  expect(world.path.length).toBeGreaterThan(500);
  expect(Math.max(...speeds(world.path))).toBeLessThanOrEqual(TRAVEL * 1.0001);
});

test("frames move the spot of a hand that touches calmly, what passes before it does not", () => {
  const world = new World([0, 0, 0.05]);
  const press = new Press([0, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
  world.run(press, 1.5);
  press.follow({ at: [0, 0, 0.01], normal: up });
  expect(press.aimedAt.at[2]).toBeCloseTo(0.002, 9);
  press.follow({ at: [0, 0, 0.3], normal: up });
  expect(press.aimedAt.at[2]).toBeCloseTo(0.002, 9);
});

describe("a hand in the air", () => {
  const overFirst = [0.3, 0.2, 0.3] as const;
  const hand = { r_c, stiffness };

  test("goes after what the pixel sees, however far that has gone", () => {
    const world = new World([...overFirst], () => -0.2);
    const ahead: Ahead = ([, , z]) => ({ distance: z - world.surface, towards: up });
    const press = new Press([...overFirst], floor(0), hand, ahead);
    world.run(press, 0.2);
    // A camera that moves, or another frame of a recording: 0.2 m deeper, 0.15 m aside.
    press.follow({ at: [0.15, 0, -0.2], normal: up });
    world.run(press, 3);
    expect(world.force).toBeCloseTo(2, 1);
    expect(world.feel().hip[0]).toBeCloseTo(0.15, 3);
    expect(Math.max(...speeds(world.path))).toBeLessThanOrEqual(TRAVEL * 1.0001);
  });

  test("is before a surface that comes nearer on its way down, and never pushed through it", () => {
    const world = new World([0, 0, 0.05], (t) => Math.min(0.1, 0.1 * t));
    const press = new Press([0, 0, 0.05], floor(0), hand, (place) => ({
      distance: place[2] - world.surface,
      towards: up,
    }));
    for (let i = 0; i < 150; ++i) {
      if (i % 2 === 0) press.follow({ at: [0, 0, world.surface], normal: up });
      world.run(press, STEP);
      expect(world.feel().hip[2]).toBeGreaterThan(world.surface - 0.012);
    }
    expect(world.force).toBeCloseTo(2, 1);
  });

  test("waits outside while its place is out of the image, and presses what comes back", () => {
    let isSeen = true;
    const world = new World([0, 0, 0.05], () => (isSeen ? 0 : -1));
    const press = new Press([0, 0, 0.05], floor(0), hand, (at) => (isSeen ? overFloor(at) : null));
    world.run(press, 2);
    expect(world.force).toBeCloseTo(2, 1);
    isSeen = false;
    world.run(press, 3);
    expect(world.feel().hip[2]).toBeCloseTo(HOVER, 3);
    isSeen = true;
    world.run(press, 2);
    expect(world.force).toBeCloseTo(2, 1);
  });

  test("that is behind what is seen, and feels nothing, comes out and tries again", () => {
    const world = new World([0, 0, 0.05], () => -1); // the proxy is behind it, too
    const press = new Press([0, 0, 0.05], floor(0), hand, overFloor);
    world.run(press, 2);
    const heights = world.path.map(([, , z]) => z);
    const behind = heights.findIndex((z) => z < -0.01);
    expect(Math.max(...heights.slice(behind, behind + 1 / STEP))).toBeCloseTo(HOVER, 3);
    expect(Math.min(...heights)).toBeGreaterThan(-0.02);
  });

  test("does not chase a pixel without end that flickers between two surfaces", () => {
    const press = new Press([0, 0, 0.5], floor(0), hand, () => null);
    const path: Vec3[] = [];
    for (let i = 0; i < 1000; ++i) {
      if (i % 40 === 0) press.follow(floor(i % 80 === 0 ? 0.5 : 0));
      const hip = press.step(STEP, null);
      path.push(hip);
    }
    const way = speeds(path).reduce((sum, speed) => sum + speed * STEP, 0);
    expect(way).toBeLessThan(0.6 + LONGEST_CHASE + 2 * HOVER + 0.1);
    expect(path.slice(-200).every((place) => length(sub(place, path.at(-1)!)) < 0.05)).toBe(true);
  });
});

describe("let go", () => {
  const held = { touching: true, engaged: true, normal: up };

  test("in contact, the hand leaves the surface along its normal", () => {
    const felt: Felt = { ...held, hip: [0, 0, 0.002], proxy: [0, 0, r_c] };
    expect(outOf(felt)).toEqual([0, 0, r_c + HOVER]);
    expect(outOf({ ...felt, normal: [0, 0, 0] })).toEqual([0, 0, r_c + HOVER]);
    expect(outOf({ ...felt, touching: false })).toBeNull();
  });

  test("after a tap it goes to above the spot", () => {
    const press = new Press([0.2, 0, 0.05], floor(0), { r_c, stiffness }, overFloor);
    expect(press.retreat(null)).toEqual([0, 0, HOVER]);
    // Even if it leaves a contact elsewhere.
    const felt: Felt = { ...held, hip: [0.2, 0, 0], proxy: [0.2, 0, r_c] };
    expect(press.retreat(felt)).toEqual([0, 0, HOVER]);
  });
});

describe("a flight", () => {
  const camera: Vec3 = [0, 0, 1];
  const high = 0.1;
  const box = block([-0.05, -0.3, 0], [0.05, 0.3, high]);
  const surface = new SeenSurface(seen(both(plane([0, 0, 0], up), box), camera, [0, 0, 0]), null);
  const ahead: Ahead = (place) => {
    const hit = surface.onSightline(place);
    if (!hit) return null;
    const away = sub(camera, hit);
    const towards = scale(away, 1 / length(away));
    return { distance: dot(sub(place, hit), towards), towards };
  };

  test("goes straight where nothing is in between", () => {
    const to = above(floor(-0.2, 0.1));
    expect(flight([-0.2, -0.1, 0.04], to, ahead)).toEqual([to]);
  });

  test("goes over what is in between, and never through it", () => {
    const from: Vec3 = [-0.2, 0, 0.03];
    const to = above(floor(0.2));
    const way = [from, ...flight(from, to, ahead)];
    expect(way).toHaveLength(4);
    expect(way.at(-1)).toEqual(to);
    for (let leg = 1; leg < way.length; ++leg) {
      for (let share = 0; share <= 1; share += 0.01) {
        const [start, end] = [way[leg - 1]!, way[leg]!];
        const place = approach(start, end, share * length(sub(end, start)));
        const inside = Math.abs(place[0]) < 0.05 + r_c && place[2] < high + r_c;
        expect(inside).toBe(false);
      }
    }
  });

  test("that is planned anew with each frame does not climb", () => {
    const place: Vec3 = [-0.2, 0, 0.03];
    const hidden = floor(0.053); // in the box's shadow
    const press = new Press(place, hidden, { r_c, stiffness }, ahead);
    const heights = Array.from({ length: 300 }, () => {
      press.follow(hidden);
      return press.step(STEP, null)[2];
    });
    expect(Math.max(...heights)).toBeLessThan(2.5 * high);
  });

  test("is straight where no camera sees", () => {
    expect(flight([0, 0, 0.1], [1, 0, 0.1], () => null)).toEqual([[1, 0, 0.1]]);
  });
});
