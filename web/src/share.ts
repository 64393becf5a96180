// SPDX-License-Identifier: Apache-2.0
// A link to what is seen now: the eye, and in a recording the frame.

import { axes, eye, lookAt, type Orbit } from "./camera_math";
import type { Vec3 } from "./protocol";

/** The page's address with a view and a moment. @param frame  of a recording; null: none */
export function linkTo(address: string, orbit: Orbit, frame: number | null): string {
  const url = new URL(address);
  url.searchParams.delete("token");
  const numbers = [...eye(orbit), ...orbit.target, ...orbit.up];
  url.searchParams.set("view", numbers.map((x) => +x.toFixed(4)).join(","));
  if (frame === null) url.searchParams.delete("t");
  else url.searchParams.set("t", String(frame));
  return url.href.replaceAll("%2C", ",");
}

/** What such a link asks for; null: nothing, or nothing that can be seen. */
export function linked(search: string): { orbit: Orbit | null; frame: number | null } {
  const options = new URLSearchParams(search);
  const numbers = (options.get("view") ?? "").split(",").map(Number);
  const [at, target, up] = [0, 3, 6].map((i) => numbers.slice(i, i + 3) as unknown as Vec3);
  const isView =
    numbers.length === 9 && numbers.every(Number.isFinite) && at!.some((x, i) => x !== target![i]);
  const frame = options.has("t") ? Number(options.get("t")) : NaN;
  return {
    orbit: isView ? lookAt(at!, target!, up!) : null,
    frame: Number.isInteger(frame) && frame >= 0 ? frame : null,
  };
}

/** The picture's right, into it, and its up: the axes of a device that stands before it. */
export function deviceAxes(orbit: Orbit): [Vec3, Vec3, Vec3] {
  const { right, up, forward } = axes(orbit);
  return [right, forward, up];
}
