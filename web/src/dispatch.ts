// SPDX-License-Identifier: Apache-2.0
// What a session says, whatever way it comes: docs/protocol.md.
import type { Orbit } from "./camera_math";
import {
  decode, type Hello, type Message, type OtherHand, type RobotState, type State,
} from "./protocol";

export interface Presence {
  hand: "you" | "other" | "free";
  viewers: number;
}

export interface Handlers {
  opened(): void;
  /** @param refusal  why the program lets no session begin; null: it is lost */
  lost(refusal: string | null): void;
  hello(hello: Hello): void;
  state(state: State): void;
  presence(presence: Presence): void;
  robot(robot: RobotState): void;
  moreHands(hands: OtherHand[]): void;
  refused(reason: string): void;
  /** what the person is told */
  notice(text: string): void;
  /** from where the scene is looked at */
  orbit(): Orbit;
  message(message: Message): void;
}

/** Shows how far a file has come, or why it was refused. @param lasts  [ms]; 0: until the next */
export type Toast = (text: string, lasts?: number) => void;

export function dispatch(data: string | ArrayBuffer, handlers: Handlers): void {
  if (typeof data !== "string") return handlers.message(decode(data));
  const [[verb, what]] = Object.entries(JSON.parse(data)) as [[string, unknown]];
  if (verb === "hello") handlers.hello(what as Hello);
  if (verb === "state") handlers.state(what as State);
  if (verb === "presence") handlers.presence(what as Presence);
  if (verb === "robot") handlers.robot(what as RobotState);
  if (verb === "more_hands") handlers.moreHands(what as OtherHand[]);
  if (verb === "notice") handlers.notice(what as string);
  if (verb === "error") handlers.refused(what as string);
}
