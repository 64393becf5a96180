// SPDX-License-Identifier: Apache-2.0
import { dispatch, type Handlers, type Toast } from "./dispatch";
import type { Command, Hello } from "./protocol";

const SILENCE = 2500; // [ms] the program speaks thirty times a second
const FIRST_PAUSE = 250; // [ms] before trying again
const LONGEST_PAUSE = 2000;

/** What a page says whose token opens nothing, though none is needed. */
export const unknownToken =
  "The token in this page's address is wrong or of an earlier session: this page is for viewing " +
  "only. To operate the session, open the link that the program printed.";

/** Why the program lets no session begin; null: that is not why. @param status  of HTTP */
export function refusalText(status: number, hasToken: boolean): string | null {
  const texts: Record<number, string> = {
    401: hasToken
      ? "The token in this page's address is wrong or of an earlier session. " +
        "Open the link that the program printed."
      : "This page's address lacks its token. Open the link that the program printed.",
    403: "The program does not answer pages of this address. Open the link that it printed.",
    429: "Too many wrong tokens came from here. Wait five minutes, then open the printed link.",
    503: "Too many pages are open. Close one of them.",
  };
  return texts[status] ?? null;
}

/** The line to the program: opens, notices when it is dead, and opens again. */
export class Connection {
  private socket: WebSocket | null = null;
  private pause = FIRST_PAUSE;
  private heard = 0;
  private opened = false;
  private sending: XMLHttpRequest | null = null;
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

  /** Sends a file that is to be touched. @param name  of letters, digits, '.', '-' and '_' */
  sendFile(file: File, name: string, toast: Toast): void {
    this.sending?.abort();
    const request = (this.sending = new XMLHttpRequest());
    request.open("PUT", `/file?token=${encodeURIComponent(this.token ?? "")}&name=${name}`);
    request.upload.onprogress = ({ loaded, total }) =>
      toast(`Sending ${file.name}, ${Math.floor((100 * loaded) / total)} %`, 0);
    request.onload = () => {
      if (request.status === 200) toast(`${file.name} has arrived.`);
      else toast(request.responseText || `The program refuses ${file.name}.`, 15_000);
    };
    request.onerror = () => toast(`${file.name} could not be sent.`, 15_000);
    request.send(file);
  }

  /** The Gaussians of the splat that is felt. */
  async splat(): Promise<ArrayBuffer> {
    const answer = await fetch(this.path("/splat"), { cache: "no-store" });
    if (!answer.ok) throw new Error(await answer.text());
    return answer.arrayBuffer();
  }

  private open(): void {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}${this.path("/session")}`);
    this.socket = socket;
    this.opened = false;
    this.heard = performance.now() + SILENCE; // time to get through
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.pause = FIRST_PAUSE;
      this.opened = true;
      this.handlers.opened();
    };
    socket.onclose = () => this.drop(socket);
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      dispatch(event.data, { ...this.handlers, hello: (hello) => this.greet(hello) });
    };
  }

  private greet(hello: Hello): void {
    if (hello.operator_token) {
      // The address with which the program opened the page is good once.
      this.token = hello.operator_token;
      history.replaceState(null, "", `?token=${encodeURIComponent(this.token)}`);
    }
    this.handlers.hello(hello);
  }

  private path(of: string): string {
    return of + (this.token ? `?token=${encodeURIComponent(this.token)}` : "");
  }

  private drop(socket: WebSocket): void {
    if (socket !== this.socket) return;
    this.socket = null;
    socket.close();
    if (this.opened) this.handlers.lost(null);
    else void this.explainRefusal();
    setTimeout(() => this.open(), this.pause);
    this.pause = Math.min(2 * this.pause, LONGEST_PAUSE);
  }

  // A browser does not tell why a WebSocket did not open; the program tells who asks without one.
  private async explainRefusal(): Promise<void> {
    const status = await fetch(this.path("/session"), { cache: "no-store" }).then(
      (answer) => answer.status,
      () => 0,
    );
    if (!this.opened) this.handlers.lost(refusalText(status, this.token !== null));
  }
}
