// SPDX-License-Identifier: Apache-2.0
// Mouse, fingers and keys: they press where they point, or turn the view, or the tool in the hand.

import { Quaternion, Vector3 } from "three";
import {
  add, approach, axes, depthOf, dragged, length, metresPerPixel, scale, turned, unit, zoomed,
} from "./camera_math";
import type { Stick } from "./gamepad";
import { Pointers, type Place } from "./pointers";
import { outOf, Press, type Felt } from "./press";
import { Grip, type Quat, type Ticks, type Vec3 } from "./protocol";
import type { SceneView } from "./scene";
import { onPlane, type Spot } from "./surface";

const TURN = 0.005; // [rad] a pixel
const WHEEL = 0.00005; // [-] of the hand's distance, a pixel of wheel
const WHEEL_PRESS = 1e-5; // [m] deeper, a pixel of wheel while a pointer presses: 1 mm a notch
const ZOOM = 0.0012; // logarithm, a pixel of wheel
const KEY_SPEED = 0.16; // [-] of the hand's distance, a second
const KEY_PRESS = 0.01; // [m/s] deeper while a pointer presses
const KEY_TURN = 1.1; // [rad/s]
const ROLL = 0.001; // [rad] of the tool, a pixel of wheel
const FINE = 0.2; // [-] with Alt
const STEP = 16; // [ms]
const DEEPEST = 0.05; // [m] of the hand in what is touched: a mouse feels no wall
const REPEAT = 100; // [ms] a held hand is said again: after 0.5 s of silence it is let go
const STILL = 4; // [px] that a pointer may move and still waits for a surface
const FARTHEST_SLIDE = 0.1; // [m] over a hole, in the plane of what was pressed last

export interface HandHost {
  /** The newest tick: a hand that is taken begins at its proxy. */
  newest(): (Felt & Pick<Ticks, "orientation">) | null;
  /** Can the page move the hand at all? */
  takesHand(): boolean;
  /** contact radius [m], stiffness [N/m], and how far a tool reaches [m]; 0: it is a ball */
  touch(): { r_c: number; stiffness: number; reach: number };
  /** @param turn  of the tool; null: as it is */
  moved(grip: Grip, target: Vec3, turn: Quat | null): void;
}

export class HandInput {
  private held = false;
  private byKeys = false;
  private target: Vec3 = [0, 0, 0];
  private turn: Quat | null = null; // of a tool with a shape
  private spun: Place = { x: 0, y: 0 }; // [px] that the pressing pointer turned the tool by
  private readonly pointers = new Pointers();
  private press: Press | null = null;
  // A pointer that went down where nothing was seen, and the frames until then: where the camera
  // moves, a surface may come.
  private waits: { id: number; at: Place; frames: number } | null = null;
  // Where the pointer was last, and where a surface was seen for it, in how many frames.
  private pressed: { pointer: Place; at: Place; frames: number } | null = null;
  private readonly keys = new Set<string>();
  private timer = 0;
  private shiftHeld = false;
  private altHeld = false;
  private over: Place | null = null; // a pointer that presses nothing, if it moved

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly view: SceneView,
    private readonly host: HandHost,
  ) {
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"] as const)
      canvas.addEventListener(end, (event) => this.up(event.pointerId));
    canvas.addEventListener("pointerleave", () => (this.over = { x: -1, y: -1 }));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("keydown", (event) => this.keyDown(event));
    addEventListener("keyup", (event) => this.keys.delete(event.code));
    for (const end of ["blur", "pagehide"] as const) addEventListener(end, () => this.letGo());
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
    setInterval(() => this.held && this.moved(Grip.held, this.target), REPEAT);
  }

  /** Do drags turn the tool without a key, as fingers need it? */
  spinByDrags = false;

  private get spins(): boolean {
    return (this.spinByDrags || this.keys.has("KeyG")) && this.host.touch().reach > 0;
  }

  private moved(grip: Grip, target: Vec3): void {
    this.host.moved(grip, target, this.turn);
  }

  // Turns the tool in the picture: about its right and up, as a drag does, and about the way in.
  private spin(x: number, y: number, roll: number): void {
    if (!(this.held || this.takeByKeys()) || !this.turn) return;
    const { right, up, forward } = axes(this.view.orbit);
    const about = add(add(scale(right, y), scale(up, x)), scale(forward, roll));
    const angle = length(about);
    const by = new Quaternion().setFromAxisAngle(new Vector3(...unit(about)), angle);
    const { x: i, y: j, z: k, w } = by.multiply(new Quaternion(...this.turn)).normalize();
    this.turn = [i, j, k, w];
    this.moved(Grip.held, this.target);
  }

  /** The hand, and all fingers and keys, are off: the connection is lost, or the page left. */
  letGo(): void {
    this.keys.clear();
    this.waits = null;
    this.pointers.clear();
    this.byKeys = false;
    this.release();
  }

  /** Moves the hand in by a share of its distance, as a button does. */
  push(share: number): void {
    if (!this.press) this.takeByKeys();
    const metres = share * depthOf(this.view.orbit, this.target);
    if (this.press) this.press.refine(0.2 * metres);
    else this.moveTarget({ x: 0, y: 0 }, metres);
  }

  /** Shows where a pointer that moved over the scene would press. Before a drawing. */
  showPointer(): void {
    if (this.press) return this.view.setPointer(this.press.aimedAt);
    if (!this.over) return;
    const spot = this.host.takesHand() ? this.view.surfaceNear(this.over)?.spot : null;
    this.view.setPointer(spot ?? null);
    this.canvas.dataset.over = spot ? "surface" : "";
    this.over = null;
  }

  private take(): boolean {
    if (this.held) return true;
    const felt = this.host.newest();
    if (!felt || !this.host.takesHand()) return false;
    this.target = felt.proxy;
    this.turn = this.host.touch().reach > 0 ? felt.orientation : null;
    this.held = true;
    this.moved(Grip.held, this.target);
    return true;
  }

  private takeByKeys(): boolean {
    this.byKeys = this.take();
    return this.byKeys;
  }

  private release(): void {
    const felt = this.host.newest();
    const away = this.press?.retreat(felt) ?? (felt && outOf(felt));
    this.press = null;
    this.pressed = null;
    this.over = { x: -1, y: -1 };
    if (!this.held) return;
    this.held = false;
    this.moved(away ? Grip.letGoTowards : Grip.letGo, away ?? this.target);
  }

  private moveTarget(pixels: { x: number; y: number }, into: number): void {
    if (!this.held) return;
    this.target = dragged(this.view.orbit, this.target, pixels, into, this.view.height);
    const felt = this.host.newest();
    if (felt?.touching) this.target = approach(felt.proxy, this.target, DEEPEST);
    this.moved(Grip.held, this.target);
  }

  private down(event: PointerEvent): void {
    this.canvas.dataset.pointer = "";
    this.canvas.focus({ preventScroll: true });
    try {
      this.canvas.setPointerCapture(event.pointerId);
    } catch {
      // It is up again already: the next that is heard of it says so.
    }
    const at = { x: event.clientX, y: event.clientY };
    const near = this.pressable(at);
    const turns = event.shiftKey || event.ctrlKey;
    const held = this.pointers.hold;
    const may = { press: near !== null, spin: this.spins };
    const gesture = this.pointers.down(event.pointerId, at, event.button, turns, may);
    if (held && !this.pointers.hold) this.release();
    this.canvas.dataset.gesture = gesture;
    const { frames } = this.view;
    const mayWait = event.button === 0 && !turns && !may.spin && this.pointers.count === 1;
    this.waits = !near && mayWait ? { id: event.pointerId, at, frames } : null;
    if (this.waits) this.start();
    if (gesture === "press" && near) this.beginPress(at, near);
    if (gesture === "spin") this.take();
  }

  private pressable(at: Place): { at: Place; spot: Spot } | null {
    return this.host.takesHand() && this.host.newest() ? this.view.surfaceNear(at) : null;
  }

  private beginPress(at: Place, near: { at: Place; spot: Spot }): void {
    if (!this.take()) return;
    this.byKeys = false;
    const ahead = (place: Vec3) => this.view.ahead(place);
    this.press = new Press(this.target, near.spot, this.host.touch(), ahead);
    this.pressed = { pointer: at, at: near.at, frames: this.view.frames };
    this.spun = { x: 0, y: 0 };
    this.start();
  }

  private waitStep(): void {
    const { waits } = this;
    if (!waits || waits.frames === this.view.frames) return;
    waits.frames = this.view.frames;
    const near = this.pressable(waits.at);
    if (!near) return;
    this.waits = null;
    this.pointers.press(waits.id);
    this.canvas.dataset.gesture = "press";
    this.beginPress(waits.at, near);
  }

  private move(event: PointerEvent): void {
    const at = { x: event.clientX, y: event.clientY };
    const from = this.waits?.at;
    if (from && Math.hypot(at.x - from.x, at.y - from.y) > STILL) this.waits = null;
    const pressed = this.pointers.pressing !== null;
    const motion = this.pointers.move(event.pointerId, at, event.buttons);
    const left = at.x < 0 || at.y < 0 || at.x >= innerWidth || at.y >= innerHeight;
    if (pressed && (left || this.pointers.pressing === null)) return this.up(event.pointerId);
    if (!motion) {
      if (this.pointers.count === 0) this.over = at;
    } else if (motion.gesture === "spin" || (motion.gesture === "press" && this.spins)) {
      this.spun = { x: this.spun.x + motion.x, y: this.spun.y + motion.y };
      this.spin(TURN * motion.x, TURN * motion.y, 0);
    } else if (motion.gesture === "turn") {
      const orbit = zoomed(this.view.orbit, motion.zoom);
      this.view.setOrbit(turned(orbit, -motion.x * TURN, motion.y * TURN));
    } else if (motion.gesture === "shift") {
      this.shift(motion.x, motion.y);
    }
  }

  private up(id: number): void {
    const held = this.pointers.hold;
    this.waits = null;
    this.pointers.up(id);
    if (held && !this.pointers.hold && !this.byKeys) this.release();
    if (this.pointers.count === 0) delete this.canvas.dataset.gesture;
  }

  private shift(x: number, y: number): void {
    const { orbit } = this.view;
    const { right, up } = axes(orbit);
    const size = metresPerPixel(orbit.distance, this.view.height);
    const by = add(scale(right, -x * size), scale(up, y * size));
    this.view.setOrbit({ ...orbit, target: add(orbit.target, by) });
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 33 : event.deltaMode === 2 ? 400 : 1);
    const fine = event.altKey ? FINE : 1;
    if (this.spins) {
      this.spin(0, 0, pixels * ROLL * fine);
    } else if (!this.held || event.ctrlKey) {
      this.view.setOrbit(zoomed(this.view.orbit, Math.exp(pixels * ZOOM)));
    } else if (this.press) {
      this.press.refine(-pixels * WHEEL_PRESS * fine);
    } else {
      const depth = depthOf(this.view.orbit, this.target);
      this.moveTarget({ x: 0, y: 0 }, -pixels * WHEEL * fine * depth);
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
    if (!/^(Arrow(Up|Down|Left|Right)|Key[EQG]|Equal|Minus|Numpad(Add|Subtract))$/.test(event.code))
      return;
    event.preventDefault();
    this.keys.add(event.code);
    this.shiftHeld = event.shiftKey;
    this.altHeld = event.altKey;
    this.start();
  }

  // Steps while something presses or a key is down.
  private start(): void {
    if (this.timer !== 0) return;
    let last = performance.now();
    this.timer = window.setInterval(() => {
      const now = performance.now();
      const seconds = (now - last) / 1000;
      last = now;
      if (this.keys.size > 0) this.keyStep(seconds);
      this.waitStep();
      if (this.press) this.pressStep(this.press, seconds);
      if (this.keys.size > 0 || this.press || this.waits) return;
      clearInterval(this.timer);
      this.timer = 0;
    }, STEP);
  }

  private pressStep(press: Press, seconds: number): void {
    const { pressing } = this.pointers;
    if (!pressing || !this.pressed) return;
    const pointer = { x: pressing.x - this.spun.x, y: pressing.y - this.spun.y };
    const { x, y } = this.pressed.pointer;
    const moved = pointer.x !== x || pointer.y !== y;
    if (moved || this.view.frames !== this.pressed.frames) {
      const at = this.aimAnew(press, pointer, moved);
      this.pressed = { pointer, at, frames: this.view.frames };
    }
    const target = press.step(seconds, this.host.newest());
    if (target.every((x, i) => x === this.target[i])) return;
    this.target = target;
    this.moved(Grip.held, target);
  }

  // What is pressed now that the pointer moved, or a frame came.
  private aimAnew(press: Press, pointer: Place, moved: boolean): Place {
    const at = moved ? pointer : this.pressed!.at;
    // What is touched is followed along the camera's sightline: along the eye's, which may graze
    // the surface, noise would lead the hand away over it.
    const touched = moved || press.inAir ? null : this.view.spotAt(press.aimedAt.at);
    const spot = touched ?? this.view.spotUnder(at.x, at.y);
    const near = spot ? { at, spot } : press.inAir ? this.view.surfaceNear(pointer) : null;
    if (!near && moved) this.slideOverHole(press, pointer);
    else if (near && moved) press.aim(near.spot);
    else if (near) press.follow(near.spot);
    return near?.at ?? at;
  }

  private slideOverHole(press: Press, at: Place): void {
    const { from, along } = this.view.rayUnder(at.x, at.y);
    const place = onPlane(from, along, press.aimedAt);
    if (!place) return;
    press.aim({ ...press.aimedAt, at: approach(press.aimedAt.at, place, FARTHEST_SLIDE) });
  }

  private keyStep(seconds: number): void {
    const pressed = (more: string, less: string) =>
      Number(this.keys.has(more)) - Number(this.keys.has(less));
    let x = pressed("ArrowRight", "ArrowLeft");
    let y = pressed("ArrowDown", "ArrowUp");
    const into = pressed("KeyE", "KeyQ");
    const nearer = pressed("Equal", "Minus") + pressed("NumpadAdd", "NumpadSubtract");
    const fine = this.altHeld ? FINE : 1;
    let orbit = this.view.orbit;
    if (this.shiftHeld && (x !== 0 || y !== 0))
      orbit = turned(orbit, x * KEY_TURN * seconds, -y * KEY_TURN * seconds);
    if (nearer !== 0) orbit = zoomed(orbit, Math.exp(-nearer * seconds));
    if (orbit !== this.view.orbit) this.view.setOrbit(orbit);
    if (this.shiftHeld) [x, y] = [0, 0];
    if (this.spins) {
      const turn = KEY_TURN * fine * seconds;
      if (x !== 0 || y !== 0 || into !== 0) this.spin(x * turn, y * turn, into * turn);
      return;
    }
    this.steer({ x, y, into }, fine * seconds);
  }

  /** Moves the hand in the picture and into it, as keys or a gamepad's sticks ask. */
  steer({ x, y, into }: Stick, seconds: number): void {
    if (this.press) return this.press.refine(into * KEY_PRESS * seconds);
    if ((x === 0 && y === 0 && into === 0) || !this.takeByKeys()) return;
    const metres = KEY_SPEED * seconds;
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
