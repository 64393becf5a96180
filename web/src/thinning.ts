// SPDX-License-Identifier: Apache-2.0

/** Every how many-th pixel is drawn, along both axes, and at which share of the resolution. */
const LEVELS = [[1, 1], [2, 1], [3, 1], [4, 1], [6, 1], [6, 0.6]] as const;
const SLOW = 1 / 28;
const FAST = 1 / 45;
const PATIENCE = 45;

/** Faces of a mesh that are drawn at most, at full density. */
export const MOST_FACES = 2_000_000;

/** Are so many faces of a mesh drawn? Else its corners are, as points, which are thinned. */
export function drawsFaces(faces: number, stride: number): boolean {
  return faces <= MOST_FACES / stride ** 2;
}

/** At first where no graphics card draws: what is coarse at once is better than fine and late. */
export const SOFTWARE_LEVEL = 3;
/** Of a view that rests: all there is, or what software draws in the time of a click. */
const REST_LEVEL = { card: 0, software: 1 };

/**
 * Chooses how many points are drawn, from how long frames take: fewer at once when it is slow,
 * more again only when it has been fast for long, and never back to what was slow a moment ago.
 * Where few points do not help, as the window is large, it is the picture that gets coarser. Ticks
 * are never left out.
 */
export class Thinning {
  /** Nothing moves: the view is drawn once as finely as it can be. */
  resting = false;
  /** [s] between drawn frames, smoothed; null before the first. */
  frameTime: number | null = null;
  private fastFrames = 0;
  private patience = PATIENCE;
  private readonly rest: number;

  /** @param level  to begin with: SOFTWARE_LEVEL without a graphics card */
  constructor(private level = 0) {
    this.rest = level === 0 ? REST_LEVEL.card : REST_LEVEL.software;
  }

  get stride(): number {
    return this.shown[0];
  }

  /** Of the picture, beside what the screen could show. */
  get resolution(): number {
    return this.shown[1];
  }

  /** Would a view that rests be finer? */
  get canRefine(): boolean {
    return this.rest < this.level;
  }

  private get shown() {
    return LEVELS[this.resting ? Math.min(this.rest, this.level) : this.level]!;
  }

  /** @param seconds that the last frame took, from one drawing to the next */
  measure(seconds: number): void {
    if (!(seconds > 0) || seconds > 2) return; // a sleeping tab
    this.frameTime ??= seconds;
    this.frameTime += 0.3 * (seconds - this.frameTime);
    if (this.frameTime > SLOW && this.level < LEVELS.length - 1) {
      ++this.level;
      this.frameTime = null;
      this.fastFrames = 0;
      this.patience = Math.min(this.patience * 2, 60 * 60);
    } else if (this.frameTime < FAST && this.level > 0) {
      if (++this.fastFrames < this.patience) return;
      --this.level;
      this.frameTime = null;
      this.fastFrames = 0;
    } else {
      this.fastFrames = 0;
    }
  }
}
