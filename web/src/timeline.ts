// SPDX-License-Identifier: Apache-2.0
// Where a recording is, and what stops it, moves it and sets its speed.

import { get, write } from "./dom";
import { mayOperate } from "./panel";
import type { Command, Playback, State, Vec3 } from "./protocol";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const SEEK_INTERVAL = 120; // [ms] between two places that are asked for while one drags
const LONGEST_GAP = 300; // [ms] between two states, beyond which a recording's time is not guessed
const HELD = 700; // [ms] for which what was asked for is shown, until the program says so, too

/** Minutes and seconds, to a tenth. */
export function timeText(seconds: number): string {
  const tenths = Math.round(10 * seconds);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  return `${Math.floor(tenths / 600)}:${rest}`;
}

/** The recording that the timeline is of: the longest; null: there is none. */
export function longest(cameras: State["cameras"]): State["cameras"][number] | null {
  const recordings = cameras.filter(({ frames }) => frames > 1);
  return recordings.sort((a, b) => b.frames - a.frames)[0] ?? null;
}

/**
 * Where a recorded hand was, between the two places of its path about `time` [s]; null: the path
 * does not reach there.
 */
export function handAt(places: Float32Array, time: number): Vec3 | null {
  const last = places.length / 4 - 1;
  const t = (i: number) => places[4 * i]!;
  if (!(last > 0) || time < t(0) || time > t(last)) return null;
  let [low, high] = [0, last];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t(middle) <= time) low = middle;
    else high = middle;
  }
  const share = (time - t(low)) / Math.max(t(high) - t(low), 1e-9);
  return [1, 2, 3].map((axis) => {
    const [a, b] = [places[4 * low + axis]!, places[4 * high + axis]!];
    return a + share * (b - a);
  }) as unknown as Vec3;
}

/** The path [m] of a recorded hand in the `seconds` before a time, in `steps`. */
export function trailAt(
  places: Float32Array,
  time: number,
  seconds: number,
  steps: number,
): number[] {
  return Array.from({ length: steps + 1 }, (_, i) => time - seconds * (1 - i / steps)).flatMap(
    (t) => handAt(places, t) ?? [],
  );
}

export class Timeline {
  private readonly place = get<HTMLInputElement>("place");
  private readonly speed = get<HTMLSelectElement>("speed");
  private playback: Playback = { paused: false, loop: true, speed: 1 };
  private mayChange = false;
  private shown: { time: number; at: number } | null = null; // [s] of the frame shown, [ms] when
  private held = 0; // [ms] when it was changed here last
  private seeking = 0; // timer
  private wanted: number | null = null; // place that is still to be asked for

  constructor(private readonly ask: (command: Command) => void) {
    for (const speed of SPEEDS) this.speed.append(new Option(`${speed}×`, String(speed)));
    get("loop").addEventListener("click", () => this.set({ loop: !this.playback.loop }));
    this.speed.addEventListener("change", () => this.set({ speed: +this.speed.value }));
    this.place.addEventListener("input", () => this.seek(+this.place.value / +this.place.max));
  }

  /** [s] where the recording is now, between two states of the program; null: there is none. */
  timeNow(now: number): number | null {
    if (!this.shown) return null;
    const { paused, speed } = this.playback;
    const gone = Math.min(now - this.shown.at, LONGEST_GAP) / 1000;
    return this.shown.time + (paused ? 0 : speed * gone);
  }

  /** Stops the recording, or lets it go on. */
  pause(): void {
    if (this.mayChange) this.set({ paused: !this.playback.paused });
  }

  show(state: State, now: number): void {
    const recording = longest(state.cameras);
    const isShown = recording !== null && state.playback !== null;
    const root = get("timeline");
    if (root.hidden === isShown) root.hidden = !isShown;
    this.mayChange = isShown && mayOperate(state);
    if (!isShown) this.shown = null;
    if (!isShown) return;
    if (this.shown?.time !== recording.time) this.shown = { time: recording.time, at: now };
    for (const part of root.querySelectorAll<HTMLInputElement>("button, input, select"))
      part.disabled = !this.mayChange;
    root.title = this.mayChange ? "" : "Only the operator's page plays recordings.";
    if (now - this.held < HELD) return;
    this.playback = state.playback!;
    this.showPlayback();
    this.place.max = String(recording.frames - 1);
    this.place.value = String(recording.place);
    this.place.setAttribute("aria-valuetext", timeText(recording.time));
    write("place-text", timeText(recording.time));
  }

  private set(change: Partial<Playback>): void {
    this.held = performance.now();
    this.playback = { ...this.playback, ...change };
    this.showPlayback();
    this.ask({ play: this.playback });
  }

  private seek(share: number): void {
    this.held = performance.now();
    this.wanted = share;
    if (this.seeking) return;
    this.askForPlace();
    this.seeking = window.setInterval(() => {
      if (this.wanted !== null) return this.askForPlace();
      clearInterval(this.seeking);
      this.seeking = 0;
    }, SEEK_INTERVAL);
  }

  private askForPlace(): void {
    this.held = performance.now();
    this.ask({ seek: this.wanted! });
    this.wanted = null;
  }

  private showPlayback(): void {
    const { paused, loop, speed } = this.playback;
    get("timeline").dataset.paused = String(paused);
    get("play").setAttribute("aria-label", paused ? "Play (K)" : "Pause (K)");
    get("loop").setAttribute("aria-pressed", String(loop));
    this.speed.value = String(speed);
  }
}
