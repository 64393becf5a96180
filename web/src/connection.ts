// SPDX-License-Identifier: Apache-2.0
import { decode, type Command, type Hello, type Message, type State } from "./protocol";

const SILENCE = 2500; // [ms] the program speaks thirty times a second
const FIRST_PAUSE = 250; // [ms] before trying again
const LONGEST_PAUSE = 2000;

export interface Presence {
  hand: "you" | "other" | "free";
  viewers: number;
}

export interface Handlers {
  opened(): void;
  lost(): void;
  hello(hello: Hello): void;
  state(state: State): void;
  presence(presence: Presence): void;
  refused(reason: string): void;
  message(message: Message): void;
}

/** The line to the program: opens, notices when it is dead, and opens again. */
export class Connection {
  private socket: WebSocket | null = null;
  private pause = FIRST_PAUSE;
  private heard = 0;
  private token = new URLSearchParams(location.search).get("token");

  constructor(private readonly handlers: Handlers) {
    this.open();
    setInterval(() => {
      if (this.socket && performance.now() - this.heard > SILENCE) this.drop(this.socket);
    }, 500);
  }

  get connected(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  send(data: ArrayBuffer): void {
    if (this.connected) this.socket!.send(data);
  }

  ask(command: Command): void {
    if (this.connected) this.socket!.send(JSON.stringify(command));
  }

  private open(): void {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const query = this.token ? `?token=${encodeURIComponent(this.token)}` : "";
    const socket = new WebSocket(`${scheme}//${location.host}/session${query}`);
    this.socket = socket;
    this.heard = performance.now() + SILENCE; // time to get through
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.pause = FIRST_PAUSE;
      this.handlers.opened();
    };
    socket.onclose = () => this.drop(socket);
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      if (typeof event.data === "string") this.take(event.data);
      else this.handlers.message(decode(event.data));
    };
  }

  private take(text: string): void {
    const [[verb, what]] = Object.entries(JSON.parse(text)) as [[string, unknown]];
    if (verb === "hello") this.greet(what as Hello);
    if (verb === "state") this.handlers.state(what as State);
    if (verb === "presence") this.handlers.presence(what as Presence);
    if (verb === "error") this.handlers.refused(what as string);
  }

  private greet(hello: Hello): void {
    if (hello.operator_token) {
      // The address with which the program opened the page is good once.
      this.token = hello.operator_token;
      history.replaceState(null, "", `?token=${encodeURIComponent(this.token)}`);
    }
    this.handlers.hello(hello);
  }

  private drop(socket: WebSocket): void {
    if (socket !== this.socket) return;
    this.socket = null;
    socket.close();
    this.handlers.lost();
    setTimeout(() => this.open(), this.pause);
    this.pause = Math.min(2 * this.pause, LONGEST_PAUSE);
  }
}
