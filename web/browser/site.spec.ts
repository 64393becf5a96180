// SPDX-License-Identifier: Apache-2.0
// The page without a server, as scripts/site makes it, behind what any static host does. Where it
// was not made, there is nothing to test.

import { createReadStream, existsSync } from "node:fs";
import { createServer, type Server } from "node:http";
import type { AddressInfo } from "node:net";
import { extname, join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { drawn, glimpse, launch, placeWhere, wallPly } from "./session";

const site = fileURLToPath(new URL("../../build/site", import.meta.url));
const patience = 120_000; // [ms]
const types: Record<string, string> = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".wasm": "application/wasm",
};

let browser: Browser;
let host: Server;
let address = "";

async function open(query = ""): Promise<{ page: Page; asked: string[]; faults: string[] }> {
  const page = await browser.newPage({ viewport: { width: 900, height: 600 } });
  const asked: string[] = [];
  const faults: string[] = [];
  page.on("request", (request) => asked.push(request.url()));
  page.on("pageerror", (error) => faults.push(String(error)));
  await page.goto(`${address}/index.html${query}`, { timeout: patience });
  await drawn(page);
  return { page, asked, faults };
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

describe.skipIf(!existsSync(join(site, "index.html")))("the page of scripts/site", () => {
  beforeAll(async () => {
    host = createServer((request, answer) => {
      const file = join(site, new URL(request.url!, "http://host").pathname);
      if (file.endsWith(".ply")) return answer.end(wallPly());
      if (!existsSync(file)) return answer.writeHead(404).end();
      answer.writeHead(200, { "Content-Type": types[extname(file)] ?? "text/plain" });
      createReadStream(file).pipe(answer);
    });
    await new Promise<void>((resolve) => host.listen(0, "127.0.0.1", resolve));
    address = `http://127.0.0.1:${(host.address() as AddressInfo).port}`;
    browser = await launch();
  });
  afterAll(async () => {
    await browser.close();
    host.close();
  });

  test("a desk that a link names is pressed, and nobody else is asked for anything", async () => {
    const { page, asked, faults } = await open("?scene=desk&material=wood&size=320x240");
    const materials = () =>
      page.evaluate(() => (window as any).palpate.newest().state.paint.materials);
    expect(await materials()).toContain("wood");
    expect(asked.every((url) => url.startsWith(address))).toBe(true);
    await page.context().setOffline(true); // all that it needs is there
    await press(page);
    // What needs a server is said, with the command that gives it.
    expect(await page.locator("#toast").textContent()).toContain("scripts/run");
    expect(await page.locator("#record").isDisabled()).toBe(true);
    expect(faults).toEqual([]);
    await page.close();
  });

  test("a file that a link names is touched", async () => {
    const { page, faults } = await open("?file=cup/wall.ply");
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain("wall.ply");
    await drawn(page);
    await press(page);
    expect(faults).toEqual([]);
    await page.close();
  });

  test("a dropped file is touched, and a damaged one is refused in a sentence", async () => {
    const { page, faults } = await open("?size=320x240");
    const choose = (name: string, text: string) =>
      page.setInputFiles("#file", { name, mimeType: "text/plain", buffer: Buffer.from(text) });
    await choose("broken.ply", "ply\nformat nonsense\n");
    await expect.poll(() => page.locator("#toast").textContent()).toContain("broken.ply");
    expect((await glimpse(page)).points).toBeGreaterThan(100); // the desk is still there
    await choose("wall.ply", wallPly());
    await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain("wall.ply");
    await drawn(page);
    await press(page);
    expect(faults).toEqual([]);
    await page.close();
  });
});
