// SPDX-License-Identifier: Apache-2.0
// The page in a real browser, with the real program behind it.

import { execFileSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Browser, Page } from "playwright-core";
import { afterAll, afterEach, beforeAll, describe, expect, test } from "vitest";
import {
  difference, distance, drawn, drop, glimpse, hide, launch, newest, placeOf, placeWhere, pressDown,
  Program, says, slide, spotUnder, wallPly,
} from "./session";
import { ball, glbOf } from "../tests/splats";

const DESK = ["--camera", "synthetic:desk?size=320x240"];
const PLANE = ["--camera", "synthetic:plane?size=320x240&noise=1mm"];
const patience = 120_000; // [ms] for a machine that draws a frame a second
const r_c = 0.005; // [m] the proxy's radius

let browser: Browser;
let program: Program | null = null;
const faults: string[] = [];
const folders: string[] = [];

/** A folder for a test, gone with it. */
function temporary(): string {
  folders.push(mkdtempSync(join(tmpdir(), "palpate-page-")));
  return folders.at(-1)!;
}

async function open(options: string[], width = 900, height = 600): Promise<Page> {
  program ??= await Program.start(options);
  const page = await browser.newPage({ viewport: { width, height } });
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  await page.goto(program.url, { timeout: patience });
  await drawn(page);
  return page;
}

const until = (page: Page, what: (seen: Awaited<ReturnType<typeof glimpse>>) => boolean) =>
  expect.poll(async () => what(await glimpse(page)), { interval: 100 }).toBe(true);

async function picture(page: Page, name: string): Promise<void> {
  const folder = process.env.PALPATE_PICTURES;
  if (folder) await page.screenshot({ path: join(folder, `${name}.png`) });
}

beforeAll(async () => {
  browser = await launch();
});
afterEach(async () => {
  for (const context of browser.contexts()) await context.close();
  await program?.stop();
  program = null;
  for (const folder of folders.splice(0)) rmSync(folder, { recursive: true });
  expect(faults.splice(0)).toEqual([]);
});
afterAll(() => browser.close());

test("shows a scene that moves", async () => {
  const page = await open(["--camera", "synthetic:moving?size=320x240"]);
  const connection = page.locator("#connection");
  await expect.poll(() => connection.textContent(), { timeout: 20_000 }).toBe("connected");
  expect(await page.locator("#camera").textContent()).toContain("moving");
  expect(await page.locator("#camera").getAttribute("title")).toContain("synthetic:moving");
  // The force, its state and its reason follow each other, without room for what is not shown.
  const parts = [".hud .force", ".hud .where", "#why"].map((of) => page.locator(of).boundingBox());
  const [force, where, why] = (await Promise.all(parts)).map((box) => box!);
  expect(where!.y - force!.y - force!.height).toBeLessThan(8);
  expect(why!.y - where!.y - where!.height).toBeLessThan(8);
  // Cameras, hand and sensor are without noise: what changes in the scene's middle is the slab.
  const clip = { x: 150, y: 200, width: 400, height: 350 };
  const first = await page.screenshot({ clip });
  await expect
    .poll(async () => difference(page, first, await page.screenshot({ clip })))
    .toBeGreaterThan(300);
});

test("a tool with a shape is chosen, drawn where surfaces keep it, and turned", async () => {
  const page = await open(PLANE);
  const tool = () =>
    page.evaluate(() => {
      const { view, newest } = (window as any).palpate;
      const { orientation, proxyOrientation, torque, force, contacts } = newest().tick;
      const turn = (tool: any) => (tool.visible ? tool.quaternion.toArray() : null);
      return {
        ...{ proxy: turn(view.heldTool), hand: turn(view.handTool), ball: view.proxy.visible },
        ...{ ring: view.turning.visible, orientation, proxyOrientation, torque, reach: view.reach },
        ...{ force, contacts, arrows: view.contacts.filter((mark: any) => mark.visible).length },
      };
    });
  expect(await tool()).toMatchObject({ proxy: null, ball: true, reach: 0, arrows: 0 });
  expect(await page.locator("#torque").textContent()).toBe("");
  await page.locator("#tool").selectOption("box:40x20x5mm");
  await expect.poll(async () => (await tool()).ball).toBe(false);
  expect((await tool()).reach).toBeCloseTo(Math.hypot(20, 10, 2.5) / 1000, 6);

  // Flat on a plane: its middle rests half its thickness above it.
  const at = await pressDown(page);
  await until(page, (seen) => seen.force > 1 && Math.abs(seen.proxy[2]! - 0.0025) < 0.002);
  const before = await tool();
  expect(before.proxy).not.toBeNull();
  expect(Math.hypot(...before.torque)).toBeLessThan(0.05);

  // Turned while it presses: the plane keeps it flat, which is a torque.
  await page.keyboard.down("g");
  await page.mouse.move(at.x, at.y + 60, { steps: 6 });
  await picture(page, "tool");
  await expect.poll(async () => Math.hypot(...(await tool()).torque)).toBeGreaterThan(0.02);
  await expect.poll(async () => (await tool()).ring).toBe(true);
  await says(page, "#torque", /^[1-9]\d+ mN m$/);
  expect((await tool()).proxy).not.toBeNull();
  // 60 pixels are 0.3 rad, to which the hand turns smoothly.
  const angle = async () => 2 * Math.asin(Math.hypot(...(await tool()).orientation.slice(0, 3)));
  await expect.poll(angle).toBeCloseTo(0.3, 2);
  const turned = await tool();
  // An arrow at each contact: on the plane, together the force.
  expect(turned.arrows).toBeGreaterThan(0);
  expect(turned.arrows).toBeLessThanOrEqual(turned.contacts.length);
  for (const { at } of turned.contacts) expect(Math.abs(at[2])).toBeLessThan(0.001);
  const pushes: number[] = turned.contacts.map(({ push }: any) => push[2]);
  expect(pushes.reduce((sum, push) => sum + push)).toBeCloseTo(turned.force[2], 1);
  const halfAngle = Math.asin(Math.hypot(...turned.orientation.slice(0, 3)));
  const kept = Math.asin(Math.hypot(...turned.proxyOrientation.slice(0, 3)));
  expect(kept).toBeLessThan(halfAngle);
  // The place that is pressed stayed where it was.
  const { hip } = await glimpse(page);
  const spot = await spotUnder(page, at);
  expect(Math.hypot(hip[0]! - spot[0]!, hip[1]! - spot[1]!)).toBeLessThan(0.01);
  await page.keyboard.up("g");
  await page.mouse.up();
  await until(page, (seen) => seen.force === 0 && seen.hip[2]! > 0.015);
  await expect.poll(async () => (await tool()).arrows).toBe(0);
  expect((await tool()).orientation[3]).toBeCloseTo(turned.orientation[3], 3);

  // In the air a drag with the key turns it, and touches nothing.
  await page.keyboard.down("g");
  await pressDown(page, at);
  await page.mouse.move(at.x + 40, at.y, { steps: 4 });
  await expect
    .poll(async () => Math.abs((await tool()).orientation[3] - turned.orientation[3]))
    .toBeGreaterThan(0.003);
  expect((await glimpse(page)).state).toBe(0);
  await page.mouse.up();
  await page.keyboard.up("g");
  await page.locator("#tool").selectOption("ball");
  await expect.poll(async () => (await tool()).ball).toBe(true);
});

test("a press touches the spot that is pointed at, a drag slides, release lets go", async () => {
  const page = await open(PLANE);
  await until(page, (seen) => seen.clearance !== null);
  const before = await glimpse(page);
  expect(before.state).toBe(0);
  expect(before.clearance!).toBeGreaterThan(0.03);

  const at = await placeWhere(page, "surface");
  await page.mouse.move(at.x, at.y);
  await expect.poll(() => page.locator("#view").getAttribute("data-over")).toBe("surface");
  await page.mouse.down();
  await says(page, "#hand", "you have the hand");
  await until(page, (seen) => seen.state !== 0 && seen.force > 1.2 && seen.arrow);
  const pressed = await glimpse(page);
  const spot = await spotUnder(page, at);
  // The surface is z = 0; between points the proxy may sink in a little.
  expect(Math.hypot(pressed.proxy[0]! - spot[0]!, pressed.proxy[1]! - spot[1]!)).toBeLessThan(0.01);
  expect(pressed.proxy[2]).toBeGreaterThan(0.8 * r_c);
  expect(pressed.hip[2]).toBeLessThan(pressed.proxy[2]!);
  // What is written follows with the next drawing.
  const written = async () => Number(await page.locator("#force").textContent());
  await expect.poll(written).toBeGreaterThan(1.2);
  expect(await page.locator("#state").textContent()).toMatch(/contact|entrenched/);
  // A press of 2 N is one of 3.3 mm into the surface.
  await says(page, "#detail", /^hand 3\.\d mm inside$/);
  await says(page, "#why", /^Stiffness 600 N\/m times 3/);
  const plotted = async (index: number) => {
    const label = await page.locator(".plot .canvas").nth(index).getAttribute("aria-label");
    return parseFloat(/now (.*)/.exec(label ?? "")?.[1] ?? "");
  };
  await expect.poll(() => plotted(0)).toBeGreaterThan(0.5);
  // The number is said once: what a plot says may be older.
  expect(await page.locator(".plot output").allTextContents()).toEqual(["N", "mm"]);

  // A drag slides: the proxy stays on the surface, the hand in it.
  const there = { x: at.x + 50, y: at.y + 10 };
  await page.mouse.move(there.x, there.y, { steps: 8 });
  const next = await spotUnder(page, there);
  await until(
    page,
    ({ state, force, proxy }) =>
      state !== 0 &&
      force > 0.5 &&
      Math.hypot(proxy[0]! - next[0]!, proxy[1]! - next[1]!) < 0.01 &&
      Math.abs(proxy[2]! - r_c) < 0.3 * r_c,
  );

  // The wheel presses deeper; the proxy stays where it is.
  for (let i = 0; i < 3; ++i) await page.mouse.wheel(0, -100);
  await until(page, (seen) => seen.state !== 0 && distance(seen.hip, seen.proxy) > r_c + 0.0055);
  expect(Math.abs((await glimpse(page)).proxy[2]! - r_c)).toBeLessThan(0.002);

  // The plot says the same.
  await says(page, "#detail", /^hand [56]\.\d mm inside$/);
  await expect.poll(async () => Math.abs((await plotted(1)) - 6)).toBeLessThan(1);

  await page.mouse.up();
  await until(page, (seen) => seen.force === 0);
  await says(page, "#hand", "hand free");
  await says(page, "#why", /nobody holds.*disengaged/);
  // The hand is out again, above where it touched.
  await until(page, (seen) => seen.state === 0 && seen.hip[2]! > 0.02);
  const after = await glimpse(page);
  expect(Math.hypot(after.hip[0]! - next[0]!, after.hip[1]! - next[1]!)).toBeLessThan(0.015);
});

test("a new visitor who opens, points and holds is in contact at once", async () => {
  program = await Program.start(["--camera", "synthetic:desk"]);
  const page = await open([], 1280, 800);
  const at = await placeWhere(page, "surface");
  const began = await glimpse(page);
  await pressDown(page, at);
  await until(page, (seen) => seen.state !== 0);
  // Drawings, not seconds: a machine that draws nine a second has ten seconds for them.
  const touched = await glimpse(page);
  const count = touched.drawings - began.drawings;
  expect(count).toBeLessThan(90);
  const spot = await spotUnder(page, at);
  const { proxy } = touched;
  expect(Math.hypot(proxy[0]! - spot[0]!, proxy[1]! - spot[1]!)).toBeLessThan(0.01);
  const paint = await page.evaluate(
    () => (performance.now() - performance.getEntriesByType("paint")[0]!.startTime) / 1000,
  );
  console.log(`in contact after ${count} drawings, ${paint.toFixed(1)} s from first paint`);
});

test("a pointer held where nothing is seen presses what comes there", async () => {
  const page = await open(["--camera", "synthetic:moving?size=320x240"]);
  const at = await placeWhere(page, "surface");
  const see = (nothing: boolean) =>
    page.evaluate((nothing) => {
      const { view } = (window as any).palpate;
      if (nothing) view.surfaceNear = () => null;
      else delete view.surfaceNear;
    }, nothing);
  await see(true);
  await pressDown(page, at);
  expect(await page.locator("#view").getAttribute("data-gesture")).toBe("turn");
  await see(false);
  await until(page, (seen) => seen.state !== 0);
  expect(await page.locator("#view").getAttribute("data-gesture")).toBe("press");
  await page.mouse.up();
  // One that has moved turns the view until it is up.
  await see(true);
  await page.mouse.down();
  await page.mouse.move(at.x + 20, at.y);
  await see(false);
  await page.mouse.move(at.x, at.y);
  const { frame } = await glimpse(page);
  await until(page, (seen) => seen.frame > frame + 5);
  expect(await page.locator("#view").getAttribute("data-gesture")).toBe("turn");
  await page.mouse.up();
});

test("whatever ends a press lets the hand go", async () => {
  const page = await open(PLANE);
  const at = await placeWhere(page, "surface");
  const whose = () => page.locator("#hand").textContent();
  const ends: Record<string, () => Promise<unknown>> = {
    "the pointer leaves the window": () => page.mouse.move(at.x, -20),
    "the browser cancels the pointer": () =>
      page.locator("#view").dispatchEvent("pointercancel", { pointerId: 1 }),
    "the window loses the focus": () =>
      page.evaluate(() => window.dispatchEvent(new Event("blur"))),
    "the tab is hidden": () => hide(page),
  };
  for (const [what, end] of Object.entries(ends)) {
    await pressDown(page, at);
    await expect.poll(whose, { message: what }).toContain("you have the hand");
    await end();
    await expect.poll(whose, { message: what }).toContain("hand free");
    await until(page, (seen) => seen.force === 0);
    await page.mouse.up();
  }
});

test("a contact is heard and felt where that is asked for, and only then", async () => {
  const page = await open(PLANE);
  await page.evaluate(() => {
    Object.assign(window, { sounds: [] as AudioContext[], pulses: [] as number[] });
    const { AudioContext } = window;
    class Noted extends AudioContext {
      constructor() {
        super();
        (window as any).sounds.push(this);
      }
    }
    Object.assign(window, { AudioContext: Noted });
    const vibrate = (pulse: number) => (window as any).pulses.push(pulse) > 0;
    Object.defineProperty(navigator, "vibrate", { value: vibrate, configurable: true });
  });
  await pressDown(page);
  await until(page, (seen) => seen.force > 0.5);
  const given = () =>
    page.evaluate(() => {
      const { sounds, pulses } = window as any;
      return { sounds: sounds.map(({ state }: AudioContext) => state), pulses: pulses.length };
    });
  expect(await given()).toEqual({ sounds: [], pulses: 0 });
  const switchBoth = () =>
    page.evaluate(() => {
      for (const id of ["sound", "vibration"]) document.getElementById(id)!.click();
    });
  await switchBoth();
  await expect.poll(async () => (await given()).pulses).toBeGreaterThan(2);
  await expect.poll(async () => (await given()).sounds).toEqual(["running"]);
  const push = () => page.evaluate(() => (window as any).palpate.senses.sensation.push as number);
  await expect.poll(push).toBeGreaterThan(0.1);
  await page.mouse.up();
  await expect.poll(push).toBe(0);
  await switchBoth();
  await expect.poll(async () => (await given()).sounds).toEqual(["closed"]);
});

/** Two faces of four corners, 24 cm wide. */
const SHEET_PLY = [
  ...["ply", "format ascii 1.0", "element vertex 4"],
  ...["x", "y", "z"].map((axis) => `property float ${axis}`),
  ...["element face 1", "property list uchar int vertex_indices", "end_header"],
  ...["-0.12 -0.12 0", "0.12 -0.12 0", "0.12 0.12 0", "-0.12 0.12 0", "4 0 1 2 3", ""],
].join("\n");

test("another scene is chosen on the page", async () => {
  const page = await open(DESK);
  const asked = (uri: string) => page.locator("#scene").selectOption(uri);
  expect(await page.locator("#scene").inputValue()).toBe(DESK[1]);
  await asked("synthetic:sphere");
  await says(page, "#camera", "sphere");
  expect(await page.locator("#connection").textContent()).toBe("connected");
  expect(await page.locator("#role").textContent()).toBe("operator");
  await drawn(page);
  await pressDown(page);
  await until(page, (seen) => seen.state !== 0 && seen.force > 0.3);
  await page.mouse.up();
  // A file that is chosen, and one that is dropped, are touched; what cannot be is said.
  const folder = temporary();
  const file = join(folder, "a wall.ply");
  writeFileSync(file, wallPly());
  await page.setInputFiles("#file", file);
  await says(page, "#camera", "a_wall.ply");
  await drawn(page);
  const faces = () =>
    page.evaluate(() =>
      [...(window as any).palpate.view.clouds.values()].map(
        ({ faces }: any) => faces.visible && faces.geometry.index.count,
      ),
    );
  expect(await faces()).toEqual([3 * 2 * 120 * 120]);
  const chosen = await page.locator("#scene").inputValue();
  expect(chosen).toMatch(/^ply:.*a_wall\.ply$/);
  await drop(page, "song.mp3", "la");
  await says(page, "#toast", "song.mp3: cannot be opened");
  await drop(page, "broken.ply", "ply\nformat nonsense\n");
  // Why it is refused, which comes with the session before, not that it is sent or has arrived
  await says(page, "#toast", "broken.ply:");
  await expect.poll(() => page.locator("#scene").inputValue()).toBe(chosen);
  await drop(page, "another.ply", wallPly());
  await says(page, "#camera", "another.ply");
  expect(await page.locator("#scene optgroup[label='Opened last'] option").allTextContents())
    .toEqual(["another.ply", "a_wall.ply"]);
  // A face is pressed where it is, far from its corners.
  await drop(page, "sheet.ply", SHEET_PLY);
  await says(page, "#camera", "sheet.ply");
  const pressed = () => placeWhere(page, "surface").catch(() => null);
  await expect.poll(pressed).not.toBeNull();
  const spot = await spotUnder(page, (await pressed())!);
  expect(Math.abs(spot[2]!)).toBeLessThan(1e-4);
  expect(Math.max(Math.abs(spot[0]!), Math.abs(spot[1]!))).toBeLessThan(0.12);
  // Back to what the program was started with.
  await asked(DESK[1]!);
  await says(page, "#camera", "desk?size=320x240");
  faults.splice(0); // what the browser says of the connection that ends between two sessions
});

test("a splat is drawn as one, touched on all sides, and brought to its size", async () => {
  const page = await open(DESK);
  const size = 0.1; // [m] radius
  const buffer = glbOf(ball(6000, size), [0, 0, 0.3]);
  await page.setInputFiles("#file", { name: "ball.glb", mimeType: "model/gltf-binary", buffer });
  await expect.poll(() => page.locator("#camera").getAttribute("title")).toContain("splat:");
  await expect.poll(() => page.locator("#felt").isVisible(), { timeout: patience }).toBe(true);
  await drawn(page);
  const showsFelt = () => page.evaluate(() => (window as any).palpate.view.showsFelt as boolean);
  expect(await showsFelt()).toBe(false);
  await expect.poll(async () => (await glimpse(page)).points).toBe(6000);
  const press = async () => {
    await pressDown(page);
    await until(page, (seen) => seen.state !== 0 && seen.force > 1);
    const { proxy } = await glimpse(page);
    await page.mouse.up();
    await until(page, (seen) => seen.force === 0);
    return proxy;
  };
  // A node has moved it along z, which glTF's y up makes -y.
  const middle = [0, -0.3, 0];
  const before = await press();
  expect(Math.abs(distance(before, middle) - size - r_c)).toBeLessThan(0.003);
  await page.evaluate(() => {
    const { view } = (window as any).palpate;
    view.setOrbit({ ...view.orbit, yaw: view.orbit.yaw + Math.PI });
  });
  const behind = await press();
  expect(Math.abs(distance(behind, middle) - size - r_c)).toBeLessThan(0.003);
  expect(distance(before, behind)).toBeGreaterThan(size);
  await page.locator("#felt").dispatchEvent("click");
  expect(await showsFelt()).toBe(true);

  // Two places are said to be half as far apart as they are.
  await page.locator("#measure").dispatchEvent("click");
  const at = await placeWhere(page, "surface");
  const [one, other] = [{ x: at.x - 25, y: at.y }, { x: at.x + 25, y: at.y }];
  const apart = distance(await spotUnder(page, one), await spotUnder(page, other));
  for (const place of [one, other]) await page.mouse.click(place.x, place.y);
  expect(await page.locator("#hand").textContent()).toContain("hand free");
  await page.locator("#ruler-length").fill(String(500 * apart));
  await page.locator("#ruler-length").press("Enter");
  const title = () => page.locator("#camera").getAttribute("title");
  await expect.poll(title).toMatch(/scale=0\.(5|49|50)/);
  faults.splice(0); // what the browser says of the connection that ends between two sessions
});

test("a drag beside the surface or with the right button only turns the view", async () => {
  const page = await open(PLANE);
  const yaw = () => page.evaluate(() => (window as any).palpate.view.orbit.yaw as number);
  for (const [where, button] of [
    ["background", "left"],
    ["surface", "right"],
  ] as const) {
    const at = await placeWhere(page, where);
    const before = await yaw();
    await page.mouse.move(at.x, at.y);
    await page.mouse.down({ button });
    await page.mouse.move(at.x + 30, at.y, { steps: 3 });
    await page.mouse.up({ button });
    await expect.poll(yaw).toBeCloseTo(before - 0.15, 2);
    expect(await page.locator("#hand").textContent()).toContain("hand free");
  }
});

test("the keyboard alone moves the hand and the view", async () => {
  const page = await open(DESK);
  const start = (await glimpse(page)).proxy;
  await page.keyboard.down("ArrowRight");
  await until(page, (seen) => distance(seen.proxy, start) > 0.01);
  await page.keyboard.up("ArrowRight");
  await page.keyboard.down("KeyE");
  await until(page, (seen) => seen.state !== 0);
  await page.keyboard.up("KeyE");
  await page.keyboard.press("Space");
  await says(page, "#hand", "hand free");
  const orbit = () => page.evaluate(() => (window as any).palpate.view.orbit.yaw as number);
  const yaw = await orbit();
  await page.keyboard.down("Shift");
  await page.keyboard.down("ArrowLeft");
  await expect.poll(orbit).not.toBeCloseTo(yaw, 2);
  await page.keyboard.up("ArrowLeft");
  await page.keyboard.up("Shift");
  await page.keyboard.press("?");
  expect(await page.locator("#help").isVisible()).toBe(true);
  await page.keyboard.press("Escape");
  expect(await page.locator("#help").isVisible()).toBe(false);
});

test("a lost connection is shown and heals", async () => {
  const page = await open(DESK);
  const port = program!.port;
  await pressDown(page);
  await says(page, "#hand", "you have the hand");
  await program!.stop("SIGKILL");
  await says(page, "#connection", /^reconnecting$/);
  expect(await page.locator("#toast").isVisible()).toBe(true);
  program = await Program.start(DESK, port);
  await says(page, "#connection", /^connected$/);
  expect(await page.locator("#toast").isVisible()).toBe(false);
  await says(page, "#hand", "hand free");
  const { drawings } = await glimpse(page);
  await until(page, (seen) => seen.drawings > drawings + 3);
  // What the browser itself says about a connection that was refused is no fault of the page.
  faults.splice(0);
});

test("what one page sets, all pages show", async () => {
  const page = await open(DESK);
  const other = await open(DESK);
  await says(other, "#hand", "2 viewers");
  await page.getByRole("tab", { name: "Method" }).click();
  await slide(page, "#parameters-stiffness", 0);
  await page.locator("#method-name").selectOption("fixed-step");
  await other.getByRole("tab", { name: "Method" }).click();
  await expect.poll(() => other.locator("#method-name").inputValue()).toBe("fixed-step");
  const stiffness = other.getByLabel("stiffness, N/m", { exact: true });
  await expect.poll(() => stiffness.inputValue()).toBe("0");
  await page.locator("#method-name").selectOption("sight");
  await expect.poll(() => other.locator("#method-name").inputValue()).toBe("sight");
  // Where the hand is in the scene, too.
  await page.getByRole("tab", { name: "Session" }).click();
  await slide(page, "#placement-scale", 1000);
  await other.getByRole("tab", { name: "Session" }).click();
  await expect.poll(() => other.getByLabel("scale,").inputValue()).toBe("1000");
});

describe.each([
  [360, 640],
  [820, 1180],
  [2560, 1440],
])("at %i x %i", (width, height) => {
  test("everything has room", async () => {
    const page = await open(DESK, width, height);
    const boxes = await page.evaluate(() => {
      const of = (selector: string) => document.querySelector(selector)!.getBoundingClientRect();
      const inside = (box: DOMRect) =>
        box.left >= 0 && box.top >= 0 && box.right <= innerWidth && box.bottom <= innerHeight;
      return {
        scrolls: document.documentElement.scrollWidth > innerWidth,
        view: of("#view").height,
        inside: [".brand", ".actions", ".hud", ".panel", ".legend", "#connection"].map((selector) =>
          inside(of(selector)),
        ),
        below: of(".plot:last-child").bottom - of(".panel").bottom,
        plots: [...document.querySelectorAll(".plot .canvas")].map(
          (plot) => plot.getBoundingClientRect().width,
        ),
      };
    });
    // Nothing covers anything else, whatever is shown.
    const covered = await page.evaluate(() => {
      for (const id of ["timeline", "latched"]) document.getElementById(id)!.hidden = false;
      const over = [".brand", ".actions", "#hand", "#role", ".hud", ".latched", ".panel"];
      const boxes = [...over, ".hint", ".legend", ".timeline"].flatMap((selector) => {
        const box = document.querySelector(selector)!.getBoundingClientRect();
        return box.width > 0 ? [{ selector, box }] : [];
      });
      return boxes.flatMap(({ selector, box: a }, i) =>
        boxes
          .slice(i + 1)
          .filter(
            ({ box: b }) =>
              Math.min(a.right, b.right) - Math.max(a.left, b.left) > 0.5 &&
              Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 0.5,
          )
          .map((other) => `${selector} and ${other.selector}`),
      );
    });
    expect(covered).toEqual([]);
    expect(boxes.scrolls).toBe(false);
    expect(boxes.view).toBeGreaterThan(height / 3);
    expect(boxes.inside).toEqual([true, true, true, true, true, true]);
    if (width > 400) expect(boxes.below).toBeLessThanOrEqual(0); // on a phone one scrolls
    for (const plot of boxes.plots) expect(plot).toBeGreaterThan(200);
    // The scene is in the part of the window that is free, and fills it.
    const scene = await page.evaluate(() => {
      const { view } = (window as any).palpate;
      const { width, height } = document.getElementById("view")!.getBoundingClientRect();
      const { left, top, right, bottom } = view.room;
      const seen = (x: number, y: number) => view.spotUnder(x, y) !== null;
      const shares = [...Array(12).keys()].map((i) => (i + 0.5) / 12);
      const all = shares.flatMap((x) => shares.map((y) => [x * width, y * height] as const));
      const hits = all.filter(([x, y]) => seen(x, y));
      const free = hits.filter(([x, y]) => x > left && x < right && y > top && y < bottom);
      const area = ((right - left) * (bottom - top)) / (width * height);
      return {
        within: free.length / hits.length,
        filled: free.length / all.length / area,
      };
    });
    expect(scene.within).toBeGreaterThan(0.9);
    expect(scene.filled).toBeGreaterThan(0.2); // a wide scene in a tall window
  });
});

test("a brush paints what is touched, which then feels like that", async () => {
  const page = await open(PLANE);
  const dabs = async () => (await newest(page)).state.paint.dabs.length as number;
  await page.locator("[data-tab=method]").first().click();
  await page.locator("#brush-material").selectOption("foam");
  await page.locator("#brush-radius").fill("30");
  await page.locator("#brush-radius").press("Enter");
  await says(page, "#brush-about", "painted");
  const at = await pressDown(page);
  await expect.poll(dabs).toBeGreaterThan(0);
  await page.mouse.move(at.x + 25, at.y + 5, { steps: 5 });
  await expect.poll(dabs).toBeGreaterThan(1);
  await page.mouse.up();
  await until(page, (seen) => seen.state === 0);

  // Foam has 120 N/m; the plane has 600.
  await page.locator("#brush-material").selectOption("none");
  await pressDown(page, at);
  await until(page, ({ state, force, hip, proxy }) => {
    const depth = distance(hip, proxy) - r_c;
    return state !== 0 && depth > 0.002 && force / depth > 90 && force / depth < 160;
  });
  await page.mouse.up();
  await page.locator("#brush-clear").click();
  await expect.poll(dabs).toBe(0);
});

test("the operator keeps the hand off what it has touched", async () => {
  const page = await open(PLANE);
  const names = async () => (await newest(page)).state.fixtures.map(({ name }: any) => name);
  await page.locator("[data-tab=method]").first().click();
  const at = await placeWhere(page, "surface");
  await pressDown(page, at);
  await until(page, (seen) => seen.state !== 0 && seen.force > 0.3);
  await page.mouse.up();
  await until(page, (seen) => seen.state === 0 && seen.hip[2]! > 0.02);
  await page.locator("#forbid-margin").fill("15");
  await page.locator("#forbid").click();
  await expect.poll(names).toEqual(["keep off 1"]);
  expect(await page.locator("#fixture-list").textContent()).toContain("forbidden, seen");
  // It pushes before the surface does. The hand is soon through: what the plots keep tells.
  const now = async () => (await newest(page)).tick.t as number;
  const pushedAbove = (since: number) =>
    page.evaluate((since) => {
      const above = ({ t, force, penetration }: any) =>
        t > since && force > 0.2 && penetration === 0;
      return (window as any).palpate.history().some(above);
    }, since);
  const guarded = await now();
  await pressDown(page, at);
  await expect.poll(() => pushedAbove(guarded), { interval: 100 }).toBe(true);
  await page.mouse.up();
  await until(page, (seen) => seen.state === 0 && seen.force === 0 && seen.hip[2]! > 0.02);
  await page.locator("#fixture-list button").click();
  await expect.poll(names).toEqual([]);
  const free = await now();
  await pressDown(page, at);
  await until(page, (seen) => seen.state !== 0 && seen.force > 0.3 && seen.hip[2]! < 0);
  expect(await pushedAbove(free)).toBe(false);
  await page.mouse.up();
});

test("the operator makes a guide of what the hand has stroked", async () => {
  const page = await open(PLANE);
  const fixtures = async () => (await newest(page)).state.fixtures;
  await page.locator("[data-tab=method]").first().click();
  const at = await pressDown(page);
  await until(page, (seen) => seen.state !== 0 && seen.force > 0.3);
  for (let i = 1; i <= 20; ++i) await page.mouse.move(at.x + 3 * i, at.y);
  await until(page, (seen) => seen.state !== 0 && seen.force > 0.1);
  await page.mouse.up();
  await until(page, (seen) => seen.state === 0 && seen.hip[2]! > 0.02);
  await page.locator("#guide").click();
  await expect.poll(async () => (await fixtures()).length).toBe(1);
  const [guide] = await fixtures();
  expect(guide).toMatchObject({ name: "stroke 1", shape: "path" });
  expect(guide.points.length).toBeGreaterThan(3);
  expect(await page.locator("#fixture-list").textContent()).toContain("guide, path");
  await picture(page, "guide");
});

test("a second hand of the session is drawn and said", async () => {
  const desk = [...DESK, "--device", "mouse:", "--device", "hand:"];
  const page = await open(desk);
  const text = () => page.locator("#more-hands").textContent();
  await expect.poll(text, { timeout: 30_000 }).toMatch(/^hand_2 touches with [0-9.]+ N$/);
  const drawn = await page.evaluate(() => {
    const balls = (window as any).palpate.view.otherBalls as any[]; // proxies and HIPs in turn
    return balls.filter((_, i) => i % 2 === 0).map((ball) => ball.position.toArray() as number[]);
  });
  expect(drawn.length).toBe(1);
  expect(Math.hypot(...drawn[0]!)).toBeGreaterThan(0);
  // The mouse's hand is the first one's, as ever.
  await pressDown(page);
  await until(page, (seen) => seen.state !== 0 && seen.force > 0.3);
  await picture(page, "two_hands");
  await page.mouse.up();
});

test("the hand leads a tool at the other end of a link, and sees where it is", async () => {
  // Both ends, on a network of their own; a camera without noise would be taken for frozen.
  process.env.ROS_DOMAIN_ID = String(20 + (process.pid % 80));
  process.env.ROS_LOCALHOST_ONLY = "1";
  const robot = ["--robot", "synthetic:plane?size=320x240&noise=1mm"];
  program = await Program.start(robot, 0, undefined, "teleop");
  const page = await open([]);
  const tool = () => placeOf(page, "tool");
  await expect.poll(tool).not.toBeNull();
  await pressDown(page);
  await until(page, (seen) => seen.state !== 0 && seen.force > 0.3);
  await says(page, "#robot", "robot follows commands");
  // The tool comes to the proxy, and stays on the surface as that does.
  await expect
    .poll(async () => distance((await tool())!, (await glimpse(page)).proxy))
    .toBeLessThan(0.006);
  await picture(page, "teleop");
  await page.mouse.up();
  await says(page, "#robot", "no operator commands");
});

test("without the operator's link a page is greyed out and may hold the hand", async () => {
  const page = await open(DESK);
  expect(await page.locator("#role").textContent()).toBe("operator");
  expect(await page.locator("#record").isEnabled()).toBe(true);
  expect(await page.locator("#method-why").isHidden()).toBe(true);
  await page.close(); // two pages that draw in software are slow

  const viewer = await browser.newPage({ viewport: { width: 900, height: 600 } });
  await viewer.goto(program!.viewersUrl);
  await drawn(viewer);
  await says(viewer, "#role", /^looking on$/);
  expect(await viewer.locator("#record").isDisabled()).toBe(true);
  expect(await viewer.locator("#record").getAttribute("title")).toContain("Only the operator");
  await viewer.getByRole("tab", { name: "Method" }).click();
  expect(await viewer.locator("#method-why").textContent()).toContain("looking on");
  expect(await viewer.locator("#parameters-stiffness").isDisabled()).toBe(true);
  expect(await viewer.locator("#method-name").isDisabled()).toBe(true);

  // Whoever holds the hand sets parameters, and may make limits stricter but not looser.
  await viewer.locator("#view").focus();
  await viewer.keyboard.press("Space");
  await says(viewer, "#role", /^hand holder$/);
  await expect.poll(() => viewer.locator("#parameters-stiffness").isEnabled()).toBe(true);
  expect(await viewer.locator("#method-name").isDisabled()).toBe(true);
  await viewer.getByRole("tab", { name: "Safety" }).click();
  expect(await viewer.locator("#limits-fall_rate").isDisabled()).toBe(true);
  const force = async () => (await newest(viewer)).state.safety.max_device_force as number;
  const started = await force();
  await slide(viewer, "#limits-max_device_force", 1000);
  await says(viewer, "#toast", "the operator's");
  expect(await force()).toBe(started);
  await slide(viewer, "#limits-max_device_force", 0);
  await expect.poll(force).toBeLessThan(started);
});

test("a number field takes numbers, and what is refused goes back", async () => {
  const page = await open(DESK);
  await page.getByRole("tab", { name: "Method" }).click();
  const first = page.locator("#parameters input[type=number]").first();
  expect(await first.getAttribute("aria-label")).toBe("stiffness, N/m");
  const stiffness = async () => (await newest(page)).state.parameters.stiffness as number;
  await expect.poll(() => first.inputValue()).toBe("600");
  await first.fill("");
  await first.press("Enter");
  expect(await first.inputValue()).toBe("600");
  await first.fill("700");
  await first.press("Enter");
  await expect.poll(stiffness).toBe(700);
  // Beyond its range: refused, and the field shows again what holds, while it has the focus.
  await first.fill("1e9");
  await first.press("Enter");
  await says(page, "#toast", "stiffness");
  await expect.poll(() => first.inputValue()).toBe("700");
  await first.fill("5");
  await first.press("Escape");
  expect(await first.inputValue()).toBe("700");
  expect(await stiffness()).toBe(700);
});

test("a wrong or missing token is said on the page", async () => {
  program = await Program.start([...DESK, "--token", "of-the-viewers"]);
  for (const [query, said] of [
    ["", "lacks its token"],
    ["?token=of-somebody-else", "is wrong or of an earlier session"],
  ] as const) {
    const page = await browser.newPage();
    await page.goto(`http://localhost:${program.port}/${query}`);
    await says(page, "#toast", said);
    expect(await page.locator("#connection").textContent()).toBe("refused");
    await page.close();
  }
  await program.stop();
  // Where none is needed, a wrong one looks on, and knows that.
  program = await Program.start(DESK);
  const page = await browser.newPage();
  await page.goto(new URL("?token=of-an-earlier-session", program.viewersUrl).href);
  await says(page, "#toast", "is for viewing only");
});

test("help opens at its beginning", async () => {
  const page = await open(DESK, 360, 640);
  await page.click("#ask");
  const dialog = page.locator("#help");
  expect(await dialog.isVisible()).toBe(true);
  const { top, room } = await dialog.evaluate((box) => ({
    top: box.scrollTop,
    room: box.scrollHeight - box.clientHeight,
  }));
  expect(room).toBeGreaterThan(0);
  expect(top).toBe(0);
  expect(await page.evaluate(() => document.activeElement?.id)).toBe("help-title");
  await page.keyboard.press("Escape");
  expect(await dialog.isVisible()).toBe(false);
});

test("a recording is paused, touched and gone through; jumps take the force away", async () => {
  const folder = temporary();
  const made = join(folder, "made");
  const camera = ["--camera", "synthetic:plane?size=160x120"];
  const words = ["run", "--headless", "--duration", "4", ...camera, "--record", made];
  execFileSync(process.env.PALPATE!, words, { stdio: "ignore" });
  const page = await open(["--camera", `recording:${made}`]);
  const cameraState = async () => (await newest(page)).state.cameras[0];
  expect((await cameraState()).frames).toBe(120);
  await page.click("#play");
  await expect.poll(() => page.locator("#timeline").getAttribute("data-paused")).toBe("true");
  await expect.poll(async () => (await newest(page)).state.playback.paused).toBe(true);
  // A frame that was on its way may still come.
  let place = -1;
  const isStill = async () => {
    const before = place;
    place = (await cameraState()).place;
    return place === before;
  };
  await expect.poll(isStill, { interval: 1000 }).toBe(true);
  const ghost = () => placeOf(page, "ghost");
  await expect.poll(ghost).not.toBeNull();

  // What is paused can be touched.
  await pressDown(page);
  await until(page, (seen) => seen.force > 1);
  expect((await cameraState()).place).toBe(place);

  // A jump in time takes the force away, and it ramps up again.
  expect((await newest(page)).tick.gain).toBeGreaterThan(0.5);
  const goTo = async (frame: number) => {
    await slide(page, "#place", frame);
    await expect.poll(async () => (await cameraState()).place).toBe(frame);
  };
  await page.evaluate(() => {
    (window as any).gains = [];
    const note = () => {
      (window as any).gains.push((window as any).palpate.newest().tick.gain);
      requestAnimationFrame(note);
    };
    note();
  });
  await goTo(100);
  await expect
    .poll(() => page.evaluate(() => Math.min(...(window as any).gains)))
    .toBeLessThan(0.3);
  await until(page, (seen) => seen.force > 1);
  await page.mouse.up();
  // The recorded hand goes along: from above the plane, where it began, into it.
  const late = (await ghost())!;
  await goTo(0);
  await expect.poll(async () => (await ghost())![2]! - late[2]!).toBeGreaterThan(0.005);
  await goTo(100);
  await page.locator("#speed").selectOption("0.5");
  await page.keyboard.press("k");
  await expect.poll(async () => (await cameraState()).place).not.toBe(100);
});

test("a recording ends at its limit, and the page says so", async () => {
  const folder = temporary();
  const limits = ["--record-folder", join(folder, "made"), "--record-limit", "0.001"];
  const page = await open([...DESK, ...limits]);
  await page.click("#record");
  const pressed = () => page.locator("#record").getAttribute("aria-pressed");
  await expect.poll(pressed).toBe("true");
  await says(page, "#toast", "reached 1 MB");
  await expect.poll(pressed).toBe("false");
  expect(readdirSync(join(folder, "made"))).toHaveLength(1);
});

test("the record button records what a replay gives again, bit for bit", async () => {
  const folder = temporary();
  // A hand of the program's own, which touches all the time.
  program = await Program.start([...DESK, "--device", "hand:"], 0, folder);
  const page = await open([]);
  const pressed = () => page.locator("#record").getAttribute("aria-pressed");
  await until(page, (seen) => seen.state !== 0);
  expect(await pressed()).toBe("false");
  await page.click("#record");
  await expect.poll(pressed).toBe("true");
  expect(await page.locator("#record").getAttribute("title")).toContain("Recording palpate_");
  const { frame } = await glimpse(page);
  await until(page, (seen) => seen.frame > frame + 20);
  expect(await page.locator("#record").textContent()).toMatch(/\d:\d\d · \d+ MB/);
  await page.click("#record");
  await expect.poll(pressed).toBe("false");
  // It is written to its end while the session goes on.
  const title = () => page.locator("#record").getAttribute("title");
  await expect.poll(title).toMatch(/\d+ ticks, \d+ frames/);
  const [bag] = readdirSync(folder);
  const said = execFileSync(process.env.PALPATE!, ["replay", "--json", join(folder, bag!)]);
  expect(JSON.parse(said.toString())).toMatchObject({ identical: true });
  expect(JSON.parse(said.toString()).ticks).toBeGreaterThan(100);
  await page.click("#open-recording");
  await says(page, "#camera", bag!);
});
