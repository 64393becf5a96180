// SPDX-License-Identifier: Apache-2.0

/** [m] or [N], world axes */
export type Vec3 = [number, number, number];

/** One cycle of the servo loop. */
export interface Tick {
  /** [s] since the session was opened */
  t: number;
  /** [m, world] the hand's position, and the centre of the sphere that stays outside the surface */
  hip: Vec3;
  proxy: Vec3;
  /** [-] of the surface; zero: none was felt yet */
  normal: Vec3;
  /** [N, world] after the safety chain: what a device would get */
  force: Vec3;
  /** 0 free motion, 1 contact, 2 entrenchment (the proxy is among the points) */
  state: 0 | 1 | 2;
}

/** A session of palpate: a scene, a hand, a method, the safety chain; on the caller's clock. */
export class Session {
  /**
   * @param scene  such as `synthetic:desk?material=wood&size=320x240` (docs/synthetic.md)
   * @param onMessage  gets what a page gets (docs/protocol.md): JSON, or binary messages, and
   *                   `{ name, bytes }` of a recording that has ended
   * @throws Error with what was wrong and what to do, if the scene cannot be opened
   */
  static open(
    scene: string,
    options?: {
      onMessage?: (message: string | ArrayBuffer | { name: string; bytes: Uint8Array }) => void;
    },
  ): Promise<Session>;
  /**
   * Where the hand is to be [m, world]. It glides there, at most 1 m/s; repeat it, as after 0.5 s
   * of silence the hand is let go. A hand that is taken gets a force gradually.
   */
  hand(place: Vec3): void;
  release(): void;
  /**
   * Runs the ticks, 1000 a second, up to a time [s], which does not go back. After a gap of more
   * than 0.1 s ticks are left out.
   * @returns the newest
   */
  advance(t: number): Tick;
  /** A page's command, such as `{ set: { name: "stiffness", value: 400 } }`, `{ record: true }`. */
  command(what: object): void;
  /** Opens a .ply, .pcd, .mcap, .bag or .zip file in place of the scene, at the next `advance`. */
  file(name: string, bytes: Uint8Array): void;
}
