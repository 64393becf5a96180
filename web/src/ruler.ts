// SPDX-License-Identifier: Apache-2.0
// The scale of what has no unit: two places are picked, and the person says how far apart they are.

import { length, sub } from "./camera_math";
import { get, write } from "./dom";
import { mayOperate } from "./panel";
import { lengthText } from "./proposal";
import type { Command, State, Vec3 } from "./protocol";
import type { SceneView } from "./scene";

/** Can what is touched be opened again at another scale? */
export function canRescale({ role, cameras }: Pick<State, "role" | "cameras">): boolean {
  const hasScale = cameras.every(({ uri }) => /^(map|splat|ply|pcd):/.test(uri));
  return mayOperate({ role }) && cameras.length === 1 && hasScale;
}

/** By what lengths are to be multiplied; null: it is not known. @param wanted  [m] */
export function timesOf([a, b]: readonly Vec3[], wanted: number): number | null {
  const times = a && b ? wanted / length(sub(a, b)) : NaN;
  return times > 0 && Number.isFinite(times) ? times : null;
}

export class Ruler {
  private places: Vec3[] | null = null; // null: none are picked

  constructor(
    canvas: HTMLCanvasElement,
    private readonly view: SceneView,
    private readonly ask: (command: Command) => void,
  ) {
    get("measure").addEventListener("click", () => this.show(this.places ? null : []));
    get("ruler-end").addEventListener("click", () => this.show(null));
    get("ruler-apply").addEventListener("click", () => this.apply());
    get("ruler-length").addEventListener("keydown", ({ key }) => key === "Enter" && this.apply());
    // Before the hand takes it.
    canvas.addEventListener("pointerdown", (event) => this.pick(event), { capture: true });
  }

  /** Whether there is a scale that can be set. */
  update(state: State): void {
    get("measure").hidden = !canRescale(state);
    if (get("measure").hidden && this.places) this.show(null);
  }

  private pick(event: PointerEvent): void {
    if (!this.places || this.places.length === 2 || event.button !== 0) return;
    event.stopImmediatePropagation();
    const spot = this.view.spotUnder(event.clientX, event.clientY);
    if (spot) this.show([...this.places, spot.at]);
  }

  private show(places: Vec3[] | null): void {
    this.places = places;
    this.view.showRuler(places ?? []);
    const [a, b] = places ?? [];
    get("measure").setAttribute("aria-pressed", String(places !== null));
    get("ruler").hidden = places === null;
    for (const id of ["ruler-length", "ruler-apply"]) get(id).hidden = !b;
    write(
      "ruler-text",
      a && b
        ? `These are ${lengthText(length(sub(a, b)))} apart at this scale. In truth:`
        : `Press on ${a ? "the other" : "two places whose distance you know: on the first"}.`,
    );
    if (b) get("ruler-length").focus();
  }

  private apply(): void {
    const wanted = get<HTMLInputElement>("ruler-length").valueAsNumber / 1000;
    const times = timesOf(this.places ?? [], wanted);
    if (times === null) return;
    this.ask({ rescale: times });
    this.show(null);
  }
}
