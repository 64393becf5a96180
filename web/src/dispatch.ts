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

/** What is said in words, by its verbs. */
interface Words {
  hello(hello: Hello): void;
  state(state: State): void;
  presence(presence: Presence): void;
  robot(robot: RobotState): void;
  more_hands(hands: OtherHand[]): void;
  /** what the page asked for is refused */
  error(reason: string): void;
  /** what the person is told */
  notice(text: string): void;
}

export interface Handlers extends Words {
  opened(): void;
  /** @param refusal  why the program lets no session begin; null: it is lost */
  lost(refusal: string | null): void;
  /** from where the scene is looked at */
  orbit(): Orbit;
  message(message: Message): void;
}

/** Shows how far a file has come, or why it was refused. @param lasts  [ms]; 0: until the next */
export type Toast = (text: string, lasts?: number) => void;

export function dispatch(data: string | ArrayBuffer, handlers: Handlers): void {
  if (typeof data !== "string") return handlers.message(decode(data));
  const [[verb, what]] = Object.entries(JSON.parse(data)) as [[keyof Words, never]];
  handlers[verb]?.(what);
}
