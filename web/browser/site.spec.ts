// SPDX-License-Identifier: Apache-2.0
// The page without a server, as scripts/site makes it, behind what any static host does. Where it
// was not made, there is nothing to test. PALPATE_SITE_SPEED=1 measures it too.

import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readdirSync, rmSync } from "node:fs";
import type { Server } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { zipSync, zlibSync } from "fflate";
import { afterAll, afterEach, beforeAll, describe, expect, test } from "vitest";
import { InverseService } from "./inverse_service";
import { ball, plyOf, spzOf } from "../tests/splats";
import {
  drawn, drop, glimpse, hide, hosted, launch, newest, placeWhere, pressDown, says, wallPly,
} from "./session";

const site = fileURLToPath(new URL("../../build/site", import.meta.url));
const patience = 120_000; // [ms]
let browser: Browser;
let host: Server;
let address = "";
const faults: string[] = [];

/** @param before  runs in the page before all else */
async function open(query = "", before = () => {}): Promise<{ page: Page; asked: string[] }> {
  const page = await browser.newPage({ viewport: { width: 900, height: 600 } });
  const asked: string[] = [];
  page.on("request", (request) => asked.push(request.url()));
  page.on("pageerror", (error) => faults.push(String(error)));
  await page.addInitScript(before);
  await page.goto(`${address}/index.html${query}`, { timeout: patience });
  await drawn(page);
  return { page, asked };
}

async function press(page: Page): Promise<void> {
  const at = await placeWhere(page, "surface");
  await page.mouse.move(at.x, at.y);
  await expect.poll(() => page.locator("#view").getAttribute("data-over")).toBe("surface");
  await page.mouse.down();
  await expect
    .poll(async () => (await glimpse(page)).force, { interval: 100 })
    .toBeGreaterThan(1.2);
  expect((await glimpse(page)).state).not.toBe(0);
  await page.mouse.up();
  await expect.poll(async () => (await glimpse(page)).force, { interval: 100 }).toBe(0);
}

const folder_of_files = mkdtempSync(join(tmpdir(), "palpate-site-"));

/** What the program's replay of a recording says. */
function replayed(recording: string): { identical: boolean; ticks: number; hash: string } {
  const said = execFileSync(process.env.PALPATE!, ["replay", "--json", recording]);
  return JSON.parse(said.toString());
}

/** What the page says of the recording that it touches. */
async function compared(page: Page): Promise<string> {
  await page.locator("#compare").click();
  await expect
    .poll(() => page.locator("#toast").textContent(), { timeout: patience })
    .toContain("replayed");
  return (await page.locator("#toast").textContent())!;
}

const identically = (hash: string) =>
  `${hash}\nasked: identical, bit for bit\nsent:  identical, bit for bit`;

/** A PNG of 16 bits: a wall at 1 m, in 5000ths of a metre. */
function depthPng(width: number, height: number): Uint8Array {
  const rows = new Uint8Array(height * (1 + 2 * width));
  for (let v = 0; v < height; ++v)
    for (let u = 0; u < width; ++u)
      rows.set([5000 >> 8, 5000 & 255], v * (1 + 2 * width) + 1 + 2 * u);
  const crcs = Array.from({ length: 256 }, (_, n) => {
    for (let bit = 0; bit < 8; ++bit) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
    return n;
  });
  const chunk = (kind: string, data: Uint8Array) => {
    const body = Buffer.concat([Buffer.from(kind), data]);
    const crc = ~body.reduce((sum, byte) => (sum >>> 8) ^ crcs[(sum ^ byte) & 255]!, ~0);
    const [size, end] = [Buffer.alloc(4), Buffer.alloc(4)];
    size.writeUInt32BE(data.length);
    end.writeInt32BE(crc);
    return Buffer.concat([size, body, end]);
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width);
  header.writeUInt32BE(height, 4);
  header.writeUInt8(16, 8);
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]),
    ...[chunk("IHDR", header), chunk("IDAT", zlibSync(rows)), chunk("IEND", Buffer.alloc(0))],
  ]);
}

/** A sequence of TUM's RGB-D benchmark, of one image, as a zip. */
function tumZip(png: Uint8Array): Buffer {
  const list = Buffer.from("1305031031.1 depth/1305031031.1.png\n");
  const poses = Buffer.from("1305031031.1 0 0 0 0 0 0 1\n");
  const texts = { "wall/depth.txt": list, "wall/groundtruth.txt": poses };
  return Buffer.from(zipSync({ ...texts, "wall/depth/1305031031.1.png": png }));
}

/** In the page: WebXR of a phone 1 m above a floor, which it looks down at. */
function simulatePhone(): void {
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const view = {
    projectionMatrix: Float32Array.from(identity, (x, i) => (i === 5 ? 4 / 3 : x)),
    transform: { matrix: Float32Array.of(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 1, 0, 1) },
  };
  const depth = {
    width: 160,
    height: 120,
    data: new Uint16Array(160 * 120).fill(2000).buffer,
    rawValueToMeters: 0.0005,
    normDepthBufferFromNormView: { matrix: Float32Array.from(identity) },
  };
  const frame = { getViewerPose: () => ({ views: [view] }), getDepthInformation: () => depth };
  class Session extends EventTarget {
    depthDataFormat = "luminance-alpha";
    private running = true;
    updateRenderState(): void {}
    requestReferenceSpace = async () => ({});
    requestAnimationFrame(draw: (time: number, of: typeof frame) => void): void {
      setTimeout(() => this.running && draw(performance.now(), frame), 33);
    }
    async end(): Promise<void> {
      this.running = false;
      this.dispatchEvent(new Event("end"));
    }
  }
  const xr = { isSessionSupported: async () => true, requestSession: async () => new Session() };
  Object.defineProperty(navigator, "xr", { value: xr });
  Object.assign(globalThis, { XRWebGLLayer: class {} });
}

describe.skipIf(!existsSync(join(site, "index.html")))("the page of scripts/site", () => {
  beforeAll(async () => {
    ({ host, address } = await hosted(site));
    browser = await launch();
  });
  afterEach(async () => {
    for (const context of browser.contexts()) await context.close();
    expect(faults.splice(0)).toEqual([]);
  });
  afterAll(async () => {
    await browser.close();
    host.close();
    rmSync(folder_of_files, { recursive: true });
  });

  test("a desk that a link names is pressed, and nobody else is asked for anything", async () => {
    const { page, asked } = await open("?scene=desk&material=wood&size=320x240");
    expect((await newest(page)).state.paint.materials).toContain("wood");
    expect(asked.every((url) => url.startsWith(address))).toBe(true);
    await page.context().setOffline(true); // all that it needs is there
    await press(page);
    // What needs a server is said, with the command that gives it.
    expect(await page.locator("#toast").textContent()).toContain("scripts/run");
  });

  test("a file that a link names is touched", async () => {
    const { page } = await open("?file=cup/wall.ply");
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain("wall.ply");
    await drawn(page);
    await press(page);
  });

  test("a dropped file is touched, and a damaged one is refused in a sentence", async () => {
    const { page } = await open("?size=320x240");
    const choose = (name: string, text: string) =>
      page.setInputFiles("#file", { name, mimeType: "text/plain", buffer: Buffer.from(text) });
    await choose("broken.ply", "ply\nformat nonsense\n");
    await says(page, "#toast", "broken.ply");
    expect((await glimpse(page)).points).toBeGreaterThan(100); // the desk is still there
    await choose("wall.ply", wallPly());
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain("wall.ply");
    await drawn(page);
    await press(page);
  });

  test("a dropped splat is drawn and met by the hand, as SPZ and as PLY", async () => {
    const { page } = await open("?size=320x240");
    const all = ball(20_000, 0.08);
    for (const [name, bytes] of [
      ["ball.spz", spzOf(all)],
      ["ball.ply", plyOf(all)],
    ] as const) {
      await drop(page, name, bytes);
      await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain(name);
      await expect.poll(() => page.locator("#felt").isVisible(), { timeout: patience }).toBe(true);
      // One in four, as a processor draws.
      await expect.poll(async () => (await glimpse(page)).points).toBe(5000);
      await pressDown(page);
      await expect
        .poll(async () => (await glimpse(page)).state, { interval: 100, timeout: patience })
        .not.toBe(0);
      await page.mouse.up();
    }
  });

  test("a recording made in the page replays in the program and in the page", async () => {
    const { page } = await open("?scene=desk&size=160x120");
    await page.locator("#record").click();
    await expect.poll(() => page.locator("#record").getAttribute("aria-pressed")).toBe("true");
    await press(page);
    // The same with a tool, which is chosen meanwhile and drawn.
    await page.locator("#tool").selectOption("box:40x20x5mm");
    const ball = () => page.evaluate(() => (window as any).palpate.view.proxy.visible as boolean);
    await expect.poll(ball).toBe(false);
    await press(page);
    const downloaded = page.waitForEvent("download");
    await page.locator("#record").click();
    const file = join(folder_of_files, (await downloaded).suggestedFilename());
    await (await downloaded).saveAs(file);
    const { identical, ticks, hash } = replayed(file);
    expect(identical).toBe(true);
    expect(ticks).toBeGreaterThan(500);
    await page.setInputFiles("#file", file);
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain(".mcap");
    expect(await compared(page)).toContain(identically(hash));
  });

  test("a recording of the program replays in the page, to the bit", async () => {
    const folder = join(folder_of_files, "of_the_program");
    const camera = "synthetic:desk?size=160x120";
    const options = ["run", "--headless", "--duration", "2", "--camera", camera];
    execFileSync(process.env.PALPATE!, [...options, "--record", folder], { stdio: "ignore" });
    const file = readdirSync(folder).find((name) => name.endsWith(".mcap"))!;
    const { page } = await open("?size=160x120");
    await page.setInputFiles("#file", join(folder, file));
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain(".mcap");
    const { hash } = replayed(folder);
    expect(await compared(page)).toContain(identically(hash));
  });

  test("the depth camera of a phone is touched, where its browser gives one", async () => {
    const { page } = await open("?size=160x120", simulatePhone);
    await page.locator("#webxr").click();
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain("webxr:");
    await drawn(page);
    await press(page);
    await page.locator("#webxr").click();
    await expect.poll(() => page.locator("#webxr").getAttribute("aria-pressed")).toBe("false");
  });

  test("images in a zip are touched, and a damaged one is refused as by the program", async () => {
    const { page } = await open("?size=160x120");
    const png = depthPng(640, 480);
    const choose = (name: string, buffer: Buffer) =>
      page.setInputFiles("#file", { name, mimeType: "application/zip", buffer });
    await choose("cut.zip", tumZip(png.subarray(0, png.length - 20)));
    await expect
      .poll(() => page.locator("#toast").textContent())
      .toContain("is a damaged PNG: it ends too early; copy or record it again, it may have");
    await choose("no.zip", Buffer.from("no zip"));
    await says(page, "#toast", "no.zip");
    await choose("wall.zip", tumZip(png));
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain("tum:");
    await drawn(page);
    await press(page);
  });

  test("an Inverse3 leads the hand with at most 0.2 N, and none when it is hidden", async () => {
    const service = await new InverseService().start();
    const { page } = await open(`?scene=plane&size=160x120&inverse3=${service.address}`);
    await page.locator("#inverse3").click();
    await expect.poll(() => service.largest(), { timeout: patience }).toBeGreaterThan(0.19);
    expect((await glimpse(page)).state).not.toBe(0);
    await hide(page);
    await expect.poll(() => Math.hypot(...service.forces.at(-1)!)).toBe(0);
    const messages = service.forces.length;
    expect(service.largest()).toBeLessThanOrEqual(0.2 + 1e-9);
    expect(await page.locator("#inverse3").getAttribute("aria-pressed")).toBe("false");
    expect(service.forces.length).toBe(messages); // nothing more is asked for
    service.stop();
  });

  test("a gamepad pushes the hand in", async () => {
    const { page } = await open("?scene=plane&size=160x120");
    await page.evaluate(() => {
      const pad = { axes: [0, 0, 0, -1], buttons: [], vibrationActuator: null };
      Object.defineProperty(navigator, "getGamepads", { value: () => [pad] });
    });
    await expect
      .poll(async () => (await glimpse(page)).force, { timeout: patience })
      .toBeGreaterThan(0.5);
  });

  test("a link leads to the same view, and after the first load without a network", async () => {
    const { page } = await open("?scene=desk&size=160x120");
    await page.evaluate(() => {
      const { view } = (window as any).palpate;
      view.setOrbit({ ...view.orbit, yaw: view.orbit.yaw + 0.5, distance: 0.8 });
    });
    const orbit = () => page.evaluate(() => (window as any).palpate.view.orbit);
    const before = await orbit();
    await page.locator("#share").click();
    expect(page.url()).toContain("view=");
    await page.evaluate(() => navigator.serviceWorker.ready);
    await page.context().setOffline(true);
    host.closeAllConnections();
    await page.reload({ timeout: patience });
    await drawn(page);
    const after = await orbit();
    for (const key of ["yaw", "pitch", "distance"]) expect(after[key]).toBeCloseTo(before[key], 3);
    await press(page);
  });
});

// The page's own thread as slow as a quarter of this computer's, and 10 Mbit/s.
test.skipIf(!process.env.PALPATE_SITE_SPEED)(
  "measures how soon a force is felt, and how often the page is drawn while pressing",
  async () => {
    const browser = await launch();
    for (const [slower, speed] of [
      [1, Infinity],
      [4, 1.25e6],
    ] as const) {
      const { host, address } = await hosted(site, speed);
      const page = await browser.newPage({ viewport: { width: 900, height: 600 } });
      const line = await page.context().newCDPSession(page);
      await line.send("Emulation.setCPUThrottlingRate", { rate: slower });
      await page.goto(`${address}/index.html`, { timeout: patience });
      await drawn(page);
      const paint = await page.evaluate(
        () => performance.getEntriesByName("first-contentful-paint")[0]!.startTime,
      );
      await pressDown(page);
      await page.waitForFunction(() =>
        ((window as any).palpate.newest().tick?.force ?? [0]).some((x: number) => x !== 0),
      );
      const felt = await page.evaluate(() => performance.now());
      const before = await glimpse(page);
      await page.waitForTimeout(4000);
      const rate = ((await glimpse(page)).drawings - before.drawings) / 4;
      const seconds = (ms: number) => (ms / 1000).toFixed(2);
      console.log(
        `${slower} x slower: first paint after ${seconds(paint)} s, first force ` +
          `${seconds(felt - paint)} s later, ${rate.toFixed(1)} pictures a second while pressing`,
      );
      await page.close();
      host.close();
    }
    await browser.close();
  },
  patience,
);

describe.skipIf(!existsSync(join(site, "../npm/index.js")))("the npm package", () => {
  test("its example presses into a plane", () => {
    const folder = join(site, "../npm");
    const said = execFileSync(process.execPath, ["example.js"], { cwd: folder }).toString();
    expect(said).toMatch(/^force -?\d+\.\d+ -?\d+\.\d+ [1-9]\d*\.\d+ N, state 1$/m);
  });
});
