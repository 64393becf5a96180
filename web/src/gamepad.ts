// SPDX-License-Identifier: Apache-2.0
// A gamepad as the hand: the left stick moves it in the picture, the right one or the triggers push
// it in and pull it back.

const REST = 0.15; // [-] of a stick's way, within which it rests

/** What is asked for, from -1 to 1: right and down in the picture, and into it. */
export interface Stick {
  x: number;
  y: number;
  into: number;
}

type Pad = Pick<Gamepad, "axes" | "buttons"> | null;

/** The first pad that is moved; null: all rest. */
export function stickOf(pads: readonly Pad[]): Stick | null {
  const beyondRest = (value = 0) =>
    Math.abs(value) < REST ? 0 : (value - Math.sign(value) * REST) / (1 - REST);
  for (const pad of pads) {
    if (!pad) continue;
    const trigger = (i: number) => pad.buttons[i]?.value ?? 0;
    const stick = {
      x: beyondRest(pad.axes[0]),
      y: beyondRest(pad.axes[1]),
      into: beyondRest(trigger(7) - trigger(6) - (pad.axes[3] ?? 0)),
    };
    if (stick.x !== 0 || stick.y !== 0 || stick.into !== 0) return stick;
  }
  return null;
}
