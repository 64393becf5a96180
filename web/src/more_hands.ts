// SPDX-License-Identifier: Apache-2.0
// The hands beside the first: what is said of them, and where their lines go.

import { add, length, scale } from "./camera_math";
import type { OtherHand, Vec3 } from "./protocol";

const ARROW = 0.02; // [m] of a line for each N

/** A line for all of them. */
export function handsText(hands: readonly OtherHand[]): string {
  return hands
    .map(({ name, force, touches, present, trouble }) => {
      if (trouble) return `${name}: ${trouble}`;
      if (!present) return `${name}: nobody holds it`;
      if (!touches) return `${name} is free`;
      return `${name} touches with ${length(force).toFixed(1)} N`;
    })
    .join(" · ");
}

/** From each HIP to its proxy, and the force there: the lines' ends, x y z after one another. */
export function handsLines(hands: readonly OtherHand[]): number[] {
  const lines = hands.flatMap(({ hip, proxy, force }): [Vec3, Vec3][] => {
    const pulled: [Vec3, Vec3] = [hip, proxy];
    return length(force) > 0 ? [pulled, [proxy, add(proxy, scale(force, ARROW))]] : [pulled];
  });
  return lines.flatMap(([from, to]) => [...from, ...to]);
}
