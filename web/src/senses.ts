// SPDX-License-Identifier: Apache-2.0
// The contact as a sound, and as a vibration of a phone or a gamepad: off until it is asked for.

import { clamp, dot, length, scale, sub } from "./camera_math";
import type { Ticks } from "./protocol";

const FULL_FORCE = 3; // [N] at which hum and vibration are strongest
const FULL_SLIDE = 0.15; // [m/s] at which the hiss is strongest
const STALE = 300; // [ms] without a tick, after which nothing is heard or felt
const PULSE = 60; // [ms] of vibration that are asked for at a time
const QUICK = 0.02; // [s] in which a sound follows

/** How a contact feels, each from 0 to 1. */
export interface Sensation {
  readonly push: number; // how hard it pushes
  readonly slide: number; // how fast the proxy slides while it is pushed
}

export const NOTHING: Sensation = { push: 0, slide: 0 };

/** Of two ticks messages after one another. A force of zero is felt as nothing, whatever moves. */
export function sensationOf(before: Ticks | null, tick: Ticks): Sensation {
  const push = clamp(length(tick.force) / FULL_FORCE, 0, 1);
  if (push === 0 || tick.state === 0) return NOTHING;
  const time = before ? tick.t - before.t : 0; // [s]
  if (!before || before.state === 0 || time <= 0) return { push, slide: 0 };
  const way = sub(tick.proxy, before.proxy);
  const along = sub(way, scale(tick.normal, dot(way, tick.normal)));
  return { push, slide: clamp(length(along) / time / FULL_SLIDE, 0, 1) * Math.sqrt(push) };
}

/** A hum that rises with the force, and the hiss of sliding. */
class Sound {
  private readonly context = new AudioContext();
  private readonly hum = this.context.createOscillator();
  private readonly humGain = this.context.createGain();
  private readonly hissFilter = this.context.createBiquadFilter();
  private readonly hissGain = this.context.createGain();

  constructor() {
    const { context } = this;
    this.hum.type = "triangle";
    this.hum.connect(this.humGain).connect(context.destination);
    const noise = context.createBuffer(1, context.sampleRate, context.sampleRate);
    const samples = noise.getChannelData(0);
    for (let i = 0; i < samples.length; ++i) samples[i] = 2 * Math.random() - 1;
    const hiss = new AudioBufferSourceNode(context, { buffer: noise, loop: true });
    this.hissFilter.type = "bandpass";
    hiss.connect(this.hissFilter).connect(this.hissGain).connect(context.destination);
    for (const gain of [this.humGain, this.hissGain]) gain.gain.value = 0;
    this.hum.start();
    hiss.start();
    void context.resume();
  }

  play({ push, slide }: Sensation): void {
    const now = this.context.currentTime;
    this.hum.frequency.setTargetAtTime(90 + 130 * push, now, QUICK);
    this.humGain.gain.setTargetAtTime(0.16 * push, now, QUICK);
    this.hissFilter.frequency.setTargetAtTime(500 + 2500 * slide, now, QUICK);
    this.hissGain.gain.setTargetAtTime(0.3 * slide, now, QUICK);
  }

  close(): void {
    void this.context.close();
  }
}

function vibrate(strength: number): void {
  navigator.vibrate?.(Math.round(PULSE * strength));
  for (const pad of navigator.getGamepads?.() ?? [])
    void pad?.vibrationActuator
      ?.playEffect("dual-rumble", {
        duration: 2 * PULSE,
        strongMagnitude: strength,
        weakMagnitude: strength,
      })
      .catch(() => {}); // one that was pulled out
}

/** What the page gives to ears and hands. */
export class Senses {
  /** what is given now; also for tests */
  sensation = NOTHING;
  private sound: Sound | null = null;
  private vibrates = false;
  private before: Ticks | null = null;
  private arrived = 0; // [ms]
  private pulsed = 0; // [ms]

  setSound(on: boolean): void {
    if (on === (this.sound !== null)) return;
    this.sound?.close();
    this.sound = on ? new Sound() : null;
  }

  setVibration(on: boolean): void {
    this.vibrates = on;
    if (!on) vibrate(0);
  }

  take(tick: Ticks, now: number): void {
    this.sensation = sensationOf(this.before, tick);
    this.before = tick;
    this.arrived = now;
  }

  /** Once for each drawing. */
  give(now: number): void {
    if (now - this.arrived > STALE || document.hidden) this.sensation = NOTHING;
    this.sound?.play(this.sensation);
    if (!this.vibrates || now - this.pulsed < PULSE) return;
    this.pulsed = now;
    const { push, slide } = this.sensation;
    if (push > 0) vibrate(clamp(0.6 * push + 0.4 * slide, 0.05, 1));
  }
}
