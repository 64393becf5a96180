// SPDX-License-Identifier: Apache-2.0
// A session of the program and a browser that looks at it, for tests and pictures.

import { spawn, type ChildProcess } from "node:child_process";
import { createReadStream, existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createServer, type Server } from "node:http";
import type { AddressInfo } from "node:net";
import { tmpdir } from "node:os";
import { extname, join } from "node:path";
import { gzipSync } from "node:zlib";
import { chromium, type Browser, type Page } from "playwright-core";
import { expect } from "vitest";

/** The program with its page, until stopped. */
export class Program {
  private constructor(
    private readonly child: ChildProcess,
    readonly url: string,
  ) {}

  /** @param cwd  where its recordings go */
  static async start(
    options: string[],
    port = 0,
    cwd?: string,
    verb = "run",
  ): Promise<Program> {
    const program = process.env.PALPATE;
    if (!program) throw new Error("PALPATE must name the program");
    const token = ["--operator-token", "of-the-browser-tests"];
    const words = [verb, "--no-browser", "--port", String(port), ...token, ...options];
    const state = mkdtempSync(join(tmpdir(), "palpate-state-"));
    const child = spawn(program, words, { cwd, env: { ...process.env, XDG_STATE_HOME: state } });
    child.on("exit", () => rmSync(state, { recursive: true }));
    let said = "";
    const url = await new Promise<string>((resolve, reject) => {
      child.stderr.on("data", (text: Buffer) => {
        said += text.toString();
        const found = /open (\S+) in a browser/.exec(said);
        if (found) resolve(found[1]!);
      });
      child.on("exit", () => reject(new Error(`the program ended: ${said}`)));
    });
    return new Program(child, url);
  }

  /** Where who only looks on, or holds the hand, finds the page. */
  get viewersUrl(): string {
    return new URL("/", this.url).href;
  }

  get port(): number {
    return Number(new URL(this.url).port);
  }

  stop(signal: NodeJS.Signals = "SIGINT"): Promise<void> {
    return new Promise((resolve) => {
      if (this.child.exitCode !== null || this.child.signalCode !== null) return resolve();
      this.child.on("exit", () => resolve());
      this.child.kill(signal);
    });
  }
}

const types: Record<string, string> = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".wasm": "application/wasm",
};

/**
 * A folder behind what any static host does; each `.ply` is a wall.
 * @param speed  [byte/s] of the line to it, by which all answers go, compressed by gzip
 */
export async function hosted(
  folder: string,
  speed = Infinity,
): Promise<{ host: Server; address: string }> {
  let free = 0; // [ms] when the line is free
  const host = createServer((request, answer) => {
    const { pathname } = new URL(request.url!, "http://host");
    const file = join(folder, pathname === "/" ? "index.html" : pathname);
    if (file.endsWith(".ply")) return answer.end(wallPly());
    if (!existsSync(file)) return answer.writeHead(404).end();
    const type = { "Content-Type": types[extname(file)] ?? "text/plain" };
    if (speed === Infinity) {
      answer.writeHead(200, type);
      return createReadStream(file).pipe(answer);
    }
    const bytes = gzipSync(readFileSync(file));
    free = Math.max(free, performance.now()) + (1000 * bytes.length) / speed;
    setTimeout(() => {
      answer.writeHead(200, { ...type, "Content-Encoding": "gzip" }).end(bytes);
    }, free - performance.now());
  });
  await new Promise<void>((resolve) => host.listen(0, "127.0.0.1", resolve));
  return { host, address: `http://127.0.0.1:${(host.address() as AddressInfo).port}` };
}

export function launch(): Promise<Browser> {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "chromium",
    // No graphics card is needed: WebGL in software. Root, who may run tests, has no sandbox.
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
}

/** What the page knows, as tests see it. */
export interface Glimpse {
  state: number;
  hip: number[];
  proxy: number[];
  force: number;
  frame: number;
  clearance: number | null;
  arrow: boolean;
  points: number;
  drawings: number;
}

export function glimpse(page: Page): Promise<Glimpse> {
  return page.evaluate(() => {
    const { view, newest } = (window as unknown as { palpate: any }).palpate;
    const { tick } = newest();
    return {
      state: tick?.state ?? 0,
      hip: tick?.hip ?? [],
      proxy: tick?.proxy ?? [],
      force: Math.hypot(...(tick?.force ?? [0])),
      frame: tick?.frame ?? -1,
      clearance: view.clearance(),
      arrow: view.arrow.visible,
      points: view.drawnPoints,
      drawings: view.drawings,
    };
  });
}

/** Where a mark of the scene is drawn [m, world]; null: it is not. */
export function placeOf(page: Page, mark: "tool" | "ghost"): Promise<number[] | null> {
  return page.evaluate((name) => {
    const drawn = (window as any).palpate.view[name];
    return drawn.visible ? (drawn.position.toArray() as number[]) : null;
  }, mark);
}

/** The surface under a place of the window [m, world]. */
export async function spotUnder(page: Page, at: { x: number; y: number }): Promise<number[]> {
  return page.evaluate(({ x, y }) => (window as any).palpate.view.spotUnder(x, y).at, at);
}

/** A place of the scene [px] with or without a surface under it and about it. */
export function placeWhere(
  page: Page,
  wanted: "surface" | "background",
): Promise<{ x: number; y: number }> {
  return page.evaluate((wanted) => {
    const { view } = (window as any).palpate;
    const canvas = document.getElementById("view")!;
    const { width, height } = canvas.getBoundingClientRect();
    const fits = (x: number, y: number) =>
      document.elementFromPoint(x, y) === canvas &&
      (view.spotUnder(x, y) !== null) === (wanted === "surface");
    // The middle first.
    for (const y of [0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.9])
      for (const x of [0.4, 0.3, 0.5, 0.6, 0.2, 0.1, 0.03]) {
        const [u, v] = [Math.round(x * width), Math.round(y * height)];
        const about = [-40, 0, 60].flatMap((du) => [-15, 0, 15].map((dv) => [u + du, v + dv]));
        const near = wanted === "surface" ? about : [[u, v]];
        if (near.every(([a, b]) => fits(a!, b!))) return { x: u, y: v };
      }
    throw new Error(`there is no ${wanted}`);
  }, wanted);
}

/** The newest tick and state that the page has. */
export function newest(page: Page): Promise<any> {
  return page.evaluate(() => (window as any).palpate.newest());
}

/** Waits until an element says something: a part of its text, or what a pattern says. */
export function says(page: Page, element: string, what: string | RegExp): Promise<void> {
  return expect.poll(() => page.locator(element).textContent()).toMatch(what);
}

/** The mouse goes down on a surface, or there. @return where */
export async function pressDown(
  page: Page,
  there?: { x: number; y: number },
): Promise<{ x: number; y: number }> {
  const at = there ?? (await placeWhere(page, "surface"));
  await page.mouse.move(at.x, at.y);
  await page.mouse.down();
  return at;
}

/** Moves a slider. */
export function slide(page: Page, slider: string, to: number): Promise<void> {
  return page.locator(slider).evaluate((slider: HTMLInputElement, to) => {
    slider.value = String(to);
    slider.dispatchEvent(new Event("input"));
  }, to);
}

/** The page's tab is hidden from now on. */
export function hide(page: Page): Promise<void> {
  return page.evaluate(() => {
    Object.defineProperty(document, "hidden", { value: true, configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
  });
}

/** Drops a file onto the page. */
export function drop(page: Page, name: string, content: string | Buffer): Promise<void> {
  return page.evaluate(
    ([name, base64]) => {
      const dataTransfer = new DataTransfer();
      const bytes = Uint8Array.from(atob(base64!), (letter) => letter.charCodeAt(0));
      dataTransfer.items.add(new File([bytes], name!));
      const given = { dataTransfer, bubbles: true, cancelable: true };
      for (const kind of ["dragover", "drop"])
        document.body.dispatchEvent(new DragEvent(kind, given));
    },
    [name, Buffer.from(content).toString("base64")],
  );
}

/** Waits until the session is drawn. */
export async function drawn(page: Page): Promise<void> {
  await page.waitForFunction(() => {
    const { view, newest } = (window as unknown as { palpate: any }).palpate ?? {};
    return view?.drawings > 3 && view.drawnPoints > 100 && newest().state && newest().tick;
  });
}

export function distance(a: readonly number[], b: readonly number[]): number {
  return Math.hypot(...a.map((x, i) => x - b[i]!));
}

/** How many of a picture's pixels differ clearly from another's. */
export function difference(page: Page, one: Buffer, other: Buffer): Promise<number> {
  return page.evaluate(
    async (pictures) => {
      const pixels = await Promise.all(
        pictures.map(async (base64) => {
          const image = new Image();
          image.src = `data:image/png;base64,${base64}`;
          await image.decode();
          const canvas = document.createElement("canvas");
          canvas.width = image.width;
          canvas.height = image.height;
          const context = canvas.getContext("2d")!;
          context.drawImage(image, 0, 0);
          return context.getImageData(0, 0, image.width, image.height).data;
        }),
      );
      const [a, b] = pixels as [Uint8ClampedArray, Uint8ClampedArray];
      let count = 0;
      for (let i = 0; i < a.length; i += 4) {
        if (Math.abs(a[i]! - b[i]!) + Math.abs(a[i + 1]! - b[i + 1]!) > 40) ++count;
      }
      return count;
    },
    [one.toString("base64"), other.toString("base64")],
  );
}

/** A sheet of 121 x 121 corners, 2 mm apart, with its faces. */
export function wallPly(): string {
  const side = 121;
  const corners: string[] = [];
  const faces: string[] = [];
  for (let v = 0; v < side; ++v)
    for (let u = 0; u < side; ++u) {
      corners.push(`${(0.002 * (u - 60)).toFixed(3)} ${(0.002 * (v - 60)).toFixed(3)} 0`);
      const at = side * v + u;
      if (u < side - 1 && v < side - 1)
        faces.push(`4 ${at} ${at + 1} ${at + side + 1} ${at + side}`);
    }
  const axes = ["x", "y", "z"].map((axis) => `property float ${axis}`);
  return [
    ...["ply", "format ascii 1.0", `element vertex ${corners.length}`, ...axes],
    ...[`element face ${faces.length}`, "property list uchar int vertex_indices", "end_header"],
    ...corners,
    ...faces,
    "",
  ].join("\n");
}
