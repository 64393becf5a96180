// SPDX-License-Identifier: Apache-2.0
// In place of connection.ts on a page without a server: the session runs in a Worker of the page.
import { dispatch, type Handlers, type Toast } from "./dispatch";
import type { Command } from "./protocol";

/** Nobody needs a token here. */
export const unknownToken = "";

/**
 * What the page's address asks for: `?scene=desk&material=wood`, of which the rest is the scene's
 * options, or `?file=URL`.
 */
export function asked(search: string): { scene: string; file: string | null } {
  const options = new URLSearchParams(search);
  const scene = options.get("scene") ?? "desk";
  const file = options.get("file");
  for (const name of ["scene", "file"]) options.delete(name);
  const more = options.toString();
  return { scene: `synthetic:${scene}${more ? `?${more}` : ""}`, file };
}

/** The line to the Worker that owns session, clock and files. */
export class Connection {
  connected = false;
  private readonly worker = new Worker("palpate-core.js");

  constructor(handlers: Handlers) {
    const { scene, file } = asked(location.search);
    this.worker.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      if (!this.connected) {
        this.connected = true;
        handlers.opened();
        if (file) void this.fetchFile(file, handlers);
      }
      dispatch(data, handlers);
    };
    this.worker.onerror = ({ message }) => {
      this.connected = false;
      handlers.lost(`The page's own palpate has ended: ${message}. Load the page again.`);
    };
    this.worker.postMessage({ open: scene });
  }

  send(data: ArrayBuffer): void {
    this.worker.postMessage(data, [data]);
  }

  ask(command: Command): void {
    this.worker.postMessage(JSON.stringify(command));
  }

  /** Gives the Worker a file that is to be touched. */
  sendFile(file: File, name: string, _toast: Toast): void {
    void file.arrayBuffer().then((bytes) => this.give(name, bytes));
  }

  private give(name: string, bytes: ArrayBuffer): void {
    this.worker.postMessage({ name, bytes: new Uint8Array(bytes) }, [bytes]);
  }

  private async fetchFile(url: string, handlers: Handlers): Promise<void> {
    try {
      const answer = await fetch(url);
      if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
      const name = new URL(url, location.href).pathname.split("/").pop() || "file";
      this.give(name.replace(/[^A-Za-z0-9._-]+/g, "_"), await answer.arrayBuffer());
    } catch (error) {
      handlers.refused(
        `${url}: it cannot be fetched: ${(error as Error).message}; ` +
          "its host must allow other pages to read it (CORS)",
      );
    }
  }
}
