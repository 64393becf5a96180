// SPDX-License-Identifier: Apache-2.0
// The brush: what is touched gets another material.

import { element, get, write } from "./dom";
import { metres } from "./fixtures";
import type { Command, State } from "./protocol";

const NONE = "none";
const ERASER = "erase";
/** [mm] */
const USUAL_RADIUS = 10;

/** What the brush's list and slider ask for; null: nothing is painted. */
export function brushOf(
  choice: string,
  millimetres: number,
): { material: string; radius: number } | null {
  if (choice === NONE) return null;
  const radius = metres(millimetres, 2, 50, USUAL_RADIUS);
  return { material: choice === ERASER ? "" : choice, radius };
}

/** A material's colour on the page: far from its neighbours' in the list. */
export function dabColour(material: string, materials: readonly string[]): string {
  const turn = 137.5; // [degrees] of the golden angle
  return `hsl(${(Math.max(materials.indexOf(material), 0) * turn) % 360}, 70%, 55%)`;
}

/** What is to be said of the paint. */
export function paintText(paint: State["paint"]): string {
  if (paint.trouble) return `${paint.trouble.charAt(0).toUpperCase()}${paint.trouble.slice(1)}.`;
  if (paint.brush)
    return paint.brush.material
      ? "Press on the surface and stroke it: what you touch is painted."
      : "Press on the surface and stroke it: what you touch is wiped.";
  const count = paint.dabs.length;
  return count === 0 ? "" : `${count} ${count === 1 ? "dab" : "dabs"} of paint.`;
}

export class Brush {
  private readonly material = get<HTMLSelectElement>("brush-material");
  private readonly radius = get<HTMLInputElement>("brush-radius");
  private readonly clear = get<HTMLButtonElement>("brush-clear");
  private offered = "";

  constructor(ask: (command: Command) => void) {
    const change = () => ask({ brush: brushOf(this.material.value, this.radius.valueAsNumber) });
    this.material.addEventListener("change", change);
    this.radius.addEventListener("change", change);
    this.clear.addEventListener("click", () => ask({ clear_paint: true }));
  }

  update({ paint, role }: State): void {
    const offered = paint.materials.join();
    if (offered !== this.offered) {
      this.offered = offered;
      this.material.replaceChildren(
        element("option", { value: NONE }, "off"),
        ...paint.materials.map((name) => element("option", { value: name }, name)),
        element("option", { value: ERASER }, "wipe"),
      );
    }
    const may = role !== "looking";
    for (const input of [this.material, this.radius]) input.disabled = !may;
    this.clear.disabled = !may || paint.dabs.length === 0;
    if (document.activeElement !== this.material)
      this.material.value = paint.brush === null ? NONE : paint.brush.material || ERASER;
    if (document.activeElement !== this.radius && paint.brush)
      this.radius.value = String(1e3 * paint.brush.radius);
    write("brush-about", paintText(paint));
  }
}
