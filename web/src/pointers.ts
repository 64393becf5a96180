// SPDX-License-Identifier: Apache-2.0
// What the pointers on the scene do: one on the surface presses; beside it, with the right button
// or Shift, or as two fingers, they turn the view; the middle button shifts it. One that
// spins turns the tool in the hand.

export type Gesture = "press" | "turn" | "shift" | "spin";

export interface Place {
  x: number; // [px]
  y: number;
}

/** How a pointer moved. */
export interface Motion {
  gesture: Gesture;
  x: number; // [px], of two fingers half
  y: number;
  zoom: number; // of two fingers: their distance before / after
}

const CLOSE = 10; // [px] two fingers this close do not pinch
const REACHES = [6, 12, 24, 48, 96]; // [px] from a place that shows nothing, where one looks
const DIRECTIONS = 8;
const OPEN = 2; // directions at most in which a hole shows nothing; beyond, it is the background

/**
 * What is found at a place of the picture, or, in a hole, at the nearest place where there is
 * something; null: the place is not surrounded by anything.
 */
export function nearestAbout<Found>(
  at: Place,
  look: (place: Place) => Found | null,
): { at: Place; found: Found } | null {
  const found = look(at);
  if (found) return { at, found };
  let nearest: { at: Place; found: Found; reach: number } | null = null;
  let open = 0;
  for (let i = 0; i < DIRECTIONS && open <= OPEN; ++i) {
    // Opposite sides first: beside a surface, that ends the search.
    const angle = (2 * Math.PI * ((i >> 1) + (i % 2) * (DIRECTIONS / 2))) / DIRECTIONS;
    const isThere = REACHES.some((reach) => {
      const place = { x: at.x + reach * Math.cos(angle), y: at.y + reach * Math.sin(angle) };
      const found = look(place);
      if (found && (!nearest || reach < nearest.reach)) nearest = { at: place, found, reach };
      return found !== null;
    });
    if (!isThere) ++open;
  }
  return open > OPEN ? null : nearest;
}

export class Pointers {
  private readonly pointers = new Map<number, { at: Place; gesture: Gesture }>();

  /** A pointer goes down. @param may  press: it is on a surface, and the hand can be had; spin: its
   * tool can be turned */
  down(
    id: number,
    at: Place,
    button: number,
    shift: boolean,
    may: { press: boolean; spin?: boolean },
  ): Gesture {
    let gesture: Gesture = "turn";
    if (button === 1) gesture = "shift";
    else if (button === 0 && !shift && this.pointers.size === 0)
      gesture = may.spin ? "spin" : may.press ? "press" : "turn";
    // A second finger: all look around now, also when one is lifted again.
    for (const pointer of this.pointers.values()) pointer.gesture = "turn";
    this.pointers.set(id, { at: { ...at }, gesture });
    return gesture;
  }

  /** @param buttons  that are down; none: its end was not told */
  move(id: number, at: Place, buttons: number): Motion | null {
    const pointer = this.pointers.get(id);
    if (!pointer) return null;
    if (buttons === 0) {
      this.pointers.delete(id);
      return null;
    }
    const share = pointer.gesture === "turn" ? 1 / this.pointers.size : 1;
    const motion: Motion = {
      gesture: pointer.gesture,
      x: share * (at.x - pointer.at.x),
      y: share * (at.y - pointer.at.y),
      zoom: 1,
    };
    const other = [...this.pointers].find(([key]) => key !== id)?.[1];
    if (other && this.pointers.size === 2) {
      const before = Math.hypot(pointer.at.x - other.at.x, pointer.at.y - other.at.y);
      const after = Math.hypot(at.x - other.at.x, at.y - other.at.y);
      if (before > CLOSE && after > CLOSE) motion.zoom = before / after;
    }
    pointer.at = { ...at };
    return motion;
  }

  /** A pointer that turned presses from now on. */
  press(id: number): void {
    const pointer = this.pointers.get(id);
    if (pointer) pointer.gesture = "press";
  }

  up(id: number): void {
    this.pointers.delete(id);
  }

  clear(): void {
    this.pointers.clear();
  }

  /** Where the pointer is that presses; null: none does. */
  get pressing(): Place | null {
    for (const { at, gesture } of this.pointers.values()) if (gesture === "press") return at;
    return null;
  }

  /** Does one press, or turn the tool? */
  get hold(): boolean {
    return [...this.pointers.values()].some(({ gesture }) => /press|spin/.test(gesture));
  }

  get count(): number {
    return this.pointers.size;
  }
}
