// SPDX-License-Identifier: Apache-2.0
// Mouse, fingers and keys: they move the hand or the eye.

import {
  add,
  axes,
  depthOf,
  dragged,
  metresPerPixel,
  scale,
  turned,
  within,
  zoomed,
} from "./camera_math";
import type { Vec3 } from "./protocol";
import type { SceneView } from "./scene";

const TURN = 0.005; // [rad] a pixel
const WHEEL = 0.00005; // [-] of the hand's distance, a pixel of wheel
const ZOOM = 0.0012; // likewise, logarithm
const KEY_SPEED = 0.16; // [-] of the hand's distance, a second
const KEY_TURN = 1.1; // [rad/s]
const KEY_TICK = 16; // [ms]
const DEEPEST = 0.05; // [m] of the hand in what is touched: a mouse feels no wall
const REPEAT = 100; // [ms] a held hand is said again: after 0.5 s of silence it is let go

export interface HandHost {
  /** Where the proxy is, and whether it touches: a hand that is taken begins there. */
  proxy(): { at: Vec3; touching: boolean } | null;
  /** Can the page move the hand at all? */
  takesHand(): boolean;
  moved(held: boolean, target: Vec3): void;
}

type Gesture = "hand" | "turn" | "shift";

export class HandInput {
  private held = false;
  private byKeys = false;
  private target: Vec3 = [0, 0, 0];
  private readonly pointers = new Map<number, { x: number; y: number; gesture: Gesture }>();
  private readonly keys = new Set<string>();
  private keyTimer = 0;
  private shiftHeld = false;
  private altHeld = false;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly view: SceneView,
    private readonly host: HandHost,
  ) {
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      canvas.addEventListener(end, (event) => this.lift(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("keydown", (event) => this.keyDown(event));
    addEventListener("keyup", (event) => this.keys.delete(event.code));
    addEventListener("blur", () => this.letGo());
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
    setInterval(() => this.held && this.host.moved(true, this.target), REPEAT);
  }

  get isHeld(): boolean {
    return this.held;
  }

  /** The hand, and all fingers and keys, are off: the connection is lost, or the page left. */
  letGo(): void {
    this.keys.clear();
    this.pointers.clear();
    this.byKeys = false;
    this.release();
  }

  /** Moves the hand into the picture by a share of its distance, as a button does. */
  push(share: number): void {
    this.takeByKeys();
    this.moveTarget({ x: 0, y: 0 }, share * depthOf(this.view.orbit, this.target));
  }

  private take(): boolean {
    if (this.held) return true;
    const proxy = this.host.proxy();
    if (!proxy || !this.host.takesHand()) return false;
    this.target = proxy.at;
    this.held = true;
    this.host.moved(true, this.target);
    return true;
  }

  private takeByKeys(): boolean {
    this.byKeys = this.take();
    return this.byKeys;
  }

  private release(): void {
    if (!this.held) return;
    this.held = false;
    this.host.moved(false, this.target);
  }

  private moveTarget(pixels: { x: number; y: number }, into: number): void {
    if (!this.held || this.keys.has("KeyC")) return;
    this.target = dragged(this.view.orbit, this.target, pixels, into, this.view.height);
    const proxy = this.host.proxy();
    if (proxy?.touching) this.target = within(this.target, proxy.at, DEEPEST);
    this.host.moved(true, this.target);
  }

  private press(event: PointerEvent): void {
    this.canvas.dataset.pointer = "";
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    let gesture: Gesture = event.button === 0 && !event.shiftKey ? "hand" : "turn";
    if (event.button === 1) gesture = "shift";
    if (gesture === "hand" && (this.pointers.size > 0 || !this.take())) gesture = "turn";
    if (this.pointers.size > 0) {
      // A second finger: both look around now.
      for (const pointer of this.pointers.values()) pointer.gesture = "turn";
      if (!this.byKeys) this.release();
    }
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, gesture });
  }

  private move(event: PointerEvent): void {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) return;
    const x = event.clientX - pointer.x;
    const y = event.clientY - pointer.y;
    if (this.pointers.size === 2) this.pinch(event);
    pointer.x = event.clientX;
    pointer.y = event.clientY;
    if (pointer.gesture === "hand") return this.moveTarget({ x, y }, 0);
    if (pointer.gesture === "shift") return this.shift(x, y);
    const share = 1 / this.pointers.size;
    this.view.setOrbit(turned(this.view.orbit, -x * TURN * share, y * TURN * share));
  }

  private pinch(event: PointerEvent): void {
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    const own = this.pointers.get(event.pointerId)!;
    if (!other) return;
    const before = Math.hypot(own.x - other.x, own.y - other.y);
    const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
    if (before > 10 && after > 10) this.view.setOrbit(zoomed(this.view.orbit, before / after));
  }

  private shift(x: number, y: number): void {
    const { orbit } = this.view;
    const { right, up } = axes(orbit);
    const size = metresPerPixel(orbit.distance, this.view.height);
    const by = add(scale(right, -x * size), scale(up, y * size));
    this.view.setOrbit({ ...orbit, target: add(orbit.target, by) });
  }

  private lift(event: PointerEvent): void {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (pointer?.gesture === "hand" && !this.byKeys) this.release();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 33 : event.deltaMode === 2 ? 400 : 1);
    if (this.held && !event.ctrlKey) {
      const fine = event.altKey ? 0.2 : 1;
      const depth = depthOf(this.view.orbit, this.target);
      this.moveTarget({ x: 0, y: 0 }, -pixels * WHEEL * fine * depth);
    } else {
      this.view.setOrbit(zoomed(this.view.orbit, Math.exp(pixels * ZOOM)));
    }
  }

  private keyDown(event: KeyboardEvent): void {
    delete this.canvas.dataset.pointer;
    if (isForForm(event) || event.ctrlKey || event.metaKey) return;
    if (event.code === "Space") {
      event.preventDefault();
      if (this.held) this.letGo();
      else this.takeByKeys();
      return;
    }
    if (!/^(Arrow(Up|Down|Left|Right)|Key[EQC]|Equal|Minus|Numpad(Add|Subtract))$/.test(event.code))
      return;
    event.preventDefault();
    this.keys.add(event.code);
    this.shiftHeld = event.shiftKey;
    this.altHeld = event.altKey;
    if (this.keyTimer === 0) {
      let last = performance.now();
      this.keyTimer = window.setInterval(() => {
        const now = performance.now();
        this.keyStep((now - last) / 1000);
        last = now;
      }, KEY_TICK);
    }
  }

  private keyStep(seconds: number): void {
    if (this.keys.size === 0) {
      clearInterval(this.keyTimer);
      this.keyTimer = 0;
      return;
    }
    const pressed = (more: string, less: string) =>
      Number(this.keys.has(more)) - Number(this.keys.has(less));
    const x = pressed("ArrowRight", "ArrowLeft");
    const y = pressed("ArrowDown", "ArrowUp");
    const into = pressed("KeyE", "KeyQ");
    const nearer = pressed("Equal", "Minus") + pressed("NumpadAdd", "NumpadSubtract");
    let orbit = this.view.orbit;
    if (this.shiftHeld && (x !== 0 || y !== 0))
      orbit = turned(orbit, x * KEY_TURN * seconds, -y * KEY_TURN * seconds);
    if (nearer !== 0) orbit = zoomed(orbit, Math.exp(-nearer * seconds));
    if (orbit !== this.view.orbit) this.view.setOrbit(orbit);
    if (this.shiftHeld || (x === 0 && y === 0 && into === 0) || !this.takeByKeys()) return;
    const metres = KEY_SPEED * (this.altHeld ? 0.2 : 1) * seconds;
    const depth = depthOf(this.view.orbit, this.target);
    const pixels = (metres * depth) / metresPerPixel(depth, this.view.height);
    this.moveTarget({ x: x * pixels, y: y * pixels }, into * metres * depth);
  }
}

/** Is a key meant for what has the focus: a slider, a number, a list, an open dialog? */
export function isForForm(event: KeyboardEvent): boolean {
  const at = event.target;
  if (!(at instanceof HTMLElement)) return false;
  if (at.closest("input, select, textarea, dialog")) return true;
  return at.closest("button, [role=tab]") !== null && /^(Space|Enter|Arrow.*)$/.test(event.code);
}
