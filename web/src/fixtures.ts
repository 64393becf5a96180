// SPDX-License-Identifier: Apache-2.0
// Virtual fixtures: where they are, as lines, and what the page adds and removes.

import { clamp, posed, scale } from "./camera_math";
import { element, get } from "./dom";
import type { Command, FixtureState, Role, State, Vec3 } from "./protocol";

const ROUND = 32; // sides of a circle
const PLATE = 0.15; // [m] half of what is drawn of a plane
const CROSS = 0.015; // [m] half of what is drawn of a point

type Line = readonly [Vec3, Vec3];

function boxLines([x, y, z]: Vec3): Line[] {
  const corner = (i: number): Vec3 => [
    (i & 1 ? 0.5 : -0.5) * x,
    (i & 2 ? 0.5 : -0.5) * y,
    (i & 4 ? 0.5 : -0.5) * z,
  ];
  const lines: Line[] = [];
  for (let i = 0; i < 8; ++i)
    for (const bit of [1, 2, 4]) if ((i & bit) === 0) lines.push([corner(i), corner(i | bit)]);
  return lines;
}

// A circle of a radius across an axis, `along` it from the middle.
function circle(radius: number, axis: 0 | 1 | 2, along = 0): Line[] {
  const at = (i: number): Vec3 => {
    const angle = (2 * Math.PI * i) / ROUND;
    const [x, y] = [radius * Math.cos(angle), radius * Math.sin(angle)];
    return ([[along, x, y], [y, along, x], [x, y, along]] as const)[axis];
  };
  return Array.from({ length: ROUND }, (_, i) => [at(i), at(i + 1)] as const);
}

function sides(radius: number, length: number): Line[] {
  const quarters = circle(radius, 2).filter((_, i) => i % (ROUND / 4) === 0);
  return quarters.map(([[x, y]]) => [[x, y, -length / 2], [x, y, length / 2]] as const);
}

function ownLines({ shape, size, radius, length, points }: FixtureState): Line[] {
  switch (shape) {
    case "box":
    case "seen":
    case "mesh":
      return boxLines(size);
    case "sphere":
      return [...circle(radius, 0), ...circle(radius, 1), ...circle(radius, 2)];
    case "cylinder":
    case "capsule": {
      const ends = [-length / 2, length / 2].flatMap((z) => circle(radius, 2, z));
      if (shape === "cylinder") return [...ends, ...sides(radius, length)];
      // Half circles over its ends, in two planes.
      const lifted = ([x, y, z]: Vec3): Vec3 => [x, y, z + Math.sign(z || 1) * (length / 2)];
      const domes = [...circle(radius, 0), ...circle(radius, 1)].map(
        ([from, to]) => [lifted(from), lifted(to)] as const,
      );
      return [...ends, ...sides(radius, length), ...domes];
    }
    case "half_space":
    case "plane":
      return boxLines([2 * PLATE, 2 * PLATE, 0]);
    case "path":
      return points.slice(1).map((point, i) => [points[i]!, point] as const);
    case "point":
      return ([[CROSS, 0, 0], [0, CROSS, 0], [0, 0, CROSS]] as const).map(
        (end) => [scale(end, -1), end] as const,
      );
  }
}

/** A fixture as lines in the world: their ends, x y z after one another. */
export function fixtureLines(fixture: FixtureState): number[] {
  return ownLines(fixture).flatMap(([from, to]) => [
    ...posed(fixture.pose, from),
    ...posed(fixture.pose, to),
  ]);
}

/** Of what a field holds in mm. */
export function metres(x: number, low: number, high: number, usual: number): number {
  return clamp(Number.isFinite(x) ? x : usual, low, high) / 1e3;
}

/** What the button that adds a region asks for, of sizes in mm. */
export function forbidOf(size: number, margin: number): { size: number; margin: number } {
  return { size: metres(size, 10, 1000, 100), margin: metres(margin, 2, 100, 10) };
}

/** What the button that adds a guide asks for, of a width in mm. */
export function guideOf(slack: number): { slack: number } {
  return { slack: metres(slack, 0, 50, 2) };
}

export class Fixtures {
  private shown = "";
  private role: Role | null = null;

  constructor(private readonly ask: (command: Command) => void) {
    const number = (id: string) => get<HTMLInputElement>(id).valueAsNumber;
    get("forbid").addEventListener("click", () =>
      ask({ forbid: forbidOf(number("forbid-size"), number("forbid-margin")) }),
    );
    get("guide").addEventListener("click", () => ask({ guide: guideOf(number("guide-slack")) }));
  }

  update({ fixtures, role }: State): void {
    const shown = fixtures.map(({ name, kind, shape }) => [name, kind, shape].join("\n")).join();
    if (shown === this.shown && role === this.role) return;
    this.shown = shown;
    this.role = role;
    const may = role === "operating";
    for (const id of ["forbid", "forbid-size", "forbid-margin", "guide", "guide-slack"])
      get<HTMLButtonElement | HTMLInputElement>(id).disabled = !may;
    get("fixture-list").replaceChildren(
      ...fixtures.map(({ name, kind, shape }) => {
        const remove = element("button", { className: "tool", title: `Remove ${name}` }, "×");
        remove.disabled = !may;
        remove.addEventListener("click", () => this.ask({ remove_fixture: name }));
        const what = `${kind}, ${shape.replaceAll("_", " ")}`;
        return element("li", {}, `${name} (${what}) `, remove);
      }),
    );
  }
}
