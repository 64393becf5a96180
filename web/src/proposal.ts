// SPDX-License-Identifier: Apache-2.0
// What is said and asked of points without an image: how far apart, and how large they are.

import type { State } from "./protocol";

type Points = NonNullable<State["points"]>;

/** For people: millimetres up to a metre. */
export function lengthText(metres: number): string {
  return metres < 1
    ? `${Number((1e3 * metres).toPrecision(3))} mm`
    : `${Number(metres.toPrecision(3))} m`;
}

/** Why the sphere is larger than the usual one; empty: it is not. [m] */
export function radiusRemark(points: Points | null, r_c: number, usual: number): string {
  if (!points || r_c <= usual) return "";
  return (
    `The points are ${lengthText(points.spacing)} apart, so the sphere is ` +
    `${lengthText(2 * r_c)} wide.`
  );
}

/** What is asked where things are too large or too small for a hand; empty: nothing is. */
export function scaleQuestion(points: Points | null): string {
  if (!points?.rescaled) return "";
  const { extent, spacing, scale } = points;
  const what =
    scale < 1
      ? `with points ${lengthText(spacing)} apart, too far for any sphere`
      : "smaller than the sphere";
  return `This is ${lengthText(extent)} long, ${what}. Touch it as ${lengthText(scale * extent)}?`;
}
