// SPDX-License-Identifier: Apache-2.0
import { describe, expect, test } from "vitest";
import { nearestAbout, Pointers, type Place } from "../src/pointers";

const SURFACE = { press: true };
const BESIDE = { press: false };
const at = (x: number, y = 0) => ({ x, y });

test("the left button presses on a surface and turns the view beside it", () => {
  const pointers = new Pointers();
  expect(pointers.down(1, at(5), 0, false, SURFACE)).toBe("press");
  expect(pointers.pressing).toEqual(at(5));
  pointers.up(1);
  expect(pointers.pressing).toBeNull();
  expect(pointers.down(1, at(5), 0, false, BESIDE)).toBe("turn");
  pointers.up(1);
  expect(pointers.down(1, at(5), 2, false, SURFACE)).toBe("turn");
  pointers.up(1);
  expect(pointers.down(1, at(5), 0, true, SURFACE)).toBe("turn");
  pointers.up(1);
  expect(pointers.down(1, at(5), 1, false, SURFACE)).toBe("shift");
});

test("where drags turn the tool, the left button does, on a surface and beside it", () => {
  const pointers = new Pointers();
  for (const press of [true, false]) {
    expect(pointers.down(1, at(5), 0, false, { press, spin: true })).toBe("spin");
    expect(pointers.pressing).toBeNull();
    expect(pointers.hold).toBe(true);
    expect(pointers.move(1, at(8, 1), 1)).toEqual({ gesture: "spin", x: 3, y: 1, zoom: 1 });
    pointers.up(1);
    expect(pointers.hold).toBe(false);
  }
  expect(pointers.down(1, at(5), 2, false, { press: true, spin: true })).toBe("turn");
});

test("a second finger ends the press, and one that stays turns the view", () => {
  const pointers = new Pointers();
  pointers.down(1, at(0), 0, false, SURFACE);
  expect(pointers.down(2, at(100), 0, false, SURFACE)).toBe("turn");
  expect(pointers.pressing).toBeNull();
  expect(pointers.move(2, at(200), 1)).toEqual({ gesture: "turn", x: 50, y: 0, zoom: 0.5 });
  pointers.up(2);
  expect(pointers.pressing).toBeNull();
  expect(pointers.move(1, at(8, 4), 1)).toEqual({ gesture: "turn", x: 8, y: 4, zoom: 1 });
  pointers.up(1);
  expect(pointers.count).toBe(0);
});

test("a pointer without a button that is down has gone, though nobody said so", () => {
  const pointers = new Pointers();
  pointers.down(1, at(0), 0, false, SURFACE);
  expect(pointers.move(1, at(1), 0)).toBeNull();
  expect(pointers.pressing).toBeNull();
  expect(pointers.count).toBe(0);
});

test("a pointer that turned the view may press from then on", () => {
  const pointers = new Pointers();
  pointers.down(1, at(3), 0, false, { press: false });
  expect(pointers.pressing).toBeNull();
  pointers.press(1);
  expect(pointers.pressing).toEqual(at(3));
  pointers.press(2);
  expect(pointers.count).toBe(1);
});

test("a press is where its pointer is", () => {
  const pointers = new Pointers();
  pointers.down(1, at(0), 0, false, SURFACE);
  pointers.move(1, at(7, 3), 1);
  expect(pointers.pressing).toEqual(at(7, 3));
  expect(pointers.move(9, at(1, 1), 1)).toBeNull();
  pointers.clear();
  expect(pointers.pressing).toBeNull();
});

describe("the nearest surface about a place", () => {
  const beside = (hole: (place: Place) => boolean) => (place: Place) =>
    hole(place) ? null : place;
  const within = (radius: number) => beside(({ x, y }) => Math.hypot(x, y) < radius);

  test("is the place itself where there is one", () => {
    expect(nearestAbout({ x: 3, y: 4 }, within(2))?.at).toEqual({ x: 3, y: 4 });
  });

  test("is beside a hole that is surrounded, on the side that is nearest", () => {
    expect(nearestAbout(at(0), within(30))).not.toBeNull();
    const near = nearestAbout(at(15), within(30))!;
    expect(near.at.x).toBeGreaterThan(29);
    expect(near.at.y).toBeCloseTo(0, 9);
    expect(near.found).toBe(near.at);
    // A hole that reaches out of the picture
    const gap = ({ x, y }: Place) => Math.abs(x) < 12 && y > -30;
    expect(nearestAbout(at(0), beside(gap))!.at.y).toBeCloseTo(0, 9);
  });

  test("is nothing beside what is seen, nor in the middle of nothing", () => {
    expect(nearestAbout(at(0), beside(({ x }) => x < 5))).toBeNull();
    expect(nearestAbout(at(0), within(1000))).toBeNull();
  });
});
