// SPDX-License-Identifier: Apache-2.0
// In place of connection.ts on a page without a server: the session runs in a Worker of the page.
import { dispatch, type Handlers, type Toast } from "./dispatch";
import { element, get } from "./dom";
import type { Command } from "./protocol";
import { deviceAxes } from "./share";
import { hasDepth, watchDepth, type DepthFrame } from "./webxr";

/** Nobody needs a token here. */
export const unknownToken = "";

const INVERSE_SERVICE = "ws://localhost:10001";
const SEEN = 100; // [ms] between two words to the Worker that the page is seen

/**
 * What the page's address asks for: `?scene=desk&material=wood`, of which the rest is the scene's
 * options, or `?file=URL`; `inverse3` is the address of Haply's service.
 */
export function asked(search: string): { scene: string; file: string | null; inverse3: string } {
  const options = new URLSearchParams(search);
  const scene = options.get("scene") ?? "desk";
  const file = options.get("file");
  const inverse3 = options.get("inverse3") ?? INVERSE_SERVICE;
  for (const name of ["scene", "file", "inverse3", "view", "t"]) options.delete(name);
  const more = options.toString();
  return { scene: `synthetic:${scene}${more ? `?${more}` : ""}`, file, inverse3 };
}

/** Gives the person a file. */
function download(name: string, bytes: Uint8Array<ArrayBuffer>): void {
  const href = URL.createObjectURL(new Blob([bytes]));
  element("a", { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), 60_000);
}

/** The line to the Worker that owns session, clock and files. */
export class Connection {
  connected = false;
  private readonly worker = new Worker("palpate-core.js");
  private takeSplat: (bytes: ArrayBuffer) => void = () => {};
  private leadByInverse3: (on: boolean) => void = () => {};

  constructor(private readonly handlers: Handlers) {
    const { scene, file, inverse3 } = asked(location.search);
    this.worker.onmessage = ({ data }) => {
      if (!this.connected) {
        this.connected = true;
        handlers.opened();
        if (file) void this.fetchFile(file);
      }
      if (data.inverse3 === null) this.leadByInverse3(false);
      else if (data.splat) this.takeSplat(data.splat);
      else if (data.bytes) download(data.name, data.bytes);
      else dispatch(data, handlers);
    };
    this.worker.onerror = ({ message }) => {
      this.connected = false;
      handlers.lost(`The page's own palpate has ended: ${message}. Load the page again.`);
    };
    this.worker.postMessage({ open: scene });
    this.offer(inverse3);
    void hasDepth().then((has) => has && this.offerDepth());
    // Offline after the first load, where the page is from https or this computer.
    void navigator.serviceWorker?.register("offline.js").catch(() => {});
  }

  // What only a page with a Worker has.
  private offer(service: string): void {
    get<HTMLInputElement>("file").accept += ",.zip";
    get("compare").hidden = false;
    get("compare").addEventListener("click", () => this.worker.postMessage('{"replay":true}'));
    const button = get("inverse3");
    button.hidden = false;
    const lead = (on: boolean) => {
      const axes = on && deviceAxes(this.handlers.orbit());
      this.worker.postMessage({ inverse3: axes ? { address: service, axes } : null });
    };
    let timer = 0;
    this.leadByInverse3 = (on) => {
      if (on === timer > 0) return;
      button.setAttribute("aria-pressed", String(on));
      clearInterval(timer);
      timer = on ? window.setInterval(() => lead(true), SEEN) : 0;
      lead(on);
    };
    button.addEventListener("click", () => this.leadByInverse3(timer === 0));
    for (const end of ["freeze", "visibilitychange"])
      document.addEventListener(end, () => {
        if (document.hidden || end === "freeze") this.leadByInverse3(false);
      });
    addEventListener("pagehide", () => this.leadByInverse3(false));
  }

  // The depth camera of this device, where its browser gives one.
  private offerDepth(): void {
    const button = get("webxr");
    button.hidden = false;
    let end: (() => void) | null = null;
    const show = (ending: (() => void) | null) => {
      end = ending;
      button.setAttribute("aria-pressed", String(ending !== null));
    };
    const refuse = ({ message }: Error) =>
      this.handlers.error(`the camera of this device: ${message}; allow it for this page`);
    button.addEventListener("click", () => {
      if (end) return end();
      const give = (depth: DepthFrame) => this.worker.postMessage({ depth });
      watchDepth(give, () => show(null)).then(show, refuse);
    });
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

  /** The Gaussians of the splat that is felt, as the program's `/splat` gives them. */
  splat(): Promise<ArrayBuffer> {
    this.worker.postMessage({ splat: true });
    return new Promise((resolve) => (this.takeSplat = resolve));
  }

  private give(name: string, bytes: ArrayBuffer): void {
    this.worker.postMessage({ name, bytes: new Uint8Array(bytes) }, [bytes]);
  }

  private async fetchFile(url: string): Promise<void> {
    try {
      const answer = await fetch(url);
      if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
      const name = new URL(url, location.href).pathname.split("/").pop() || "file";
      this.give(name.replace(/[^A-Za-z0-9._-]+/g, "_"), await answer.arrayBuffer());
    } catch (error) {
      this.handlers.error(
        `${url}: it cannot be fetched: ${(error as Error).message}; ` +
          "its host must allow other pages to read it (CORS)",
      );
    }
  }
}
