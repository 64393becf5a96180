// SPDX-License-Identifier: Apache-2.0
// Measures how quickly the page draws and answers, in a window of 1280 x 800:
//   PALPATE_SPEED="synthetic:desk FILE.pcd" PALPATE=PROGRAM web/browser/run speed
// A file is opened by the page, as if it was dropped there; anything else is given to --camera.

import { existsSync } from "node:fs";
import { test } from "vitest";
import { drawn, glimpse, launch, pressDown, Program } from "./session";

const wanted = (process.env.PALPATE_SPEED ?? "").split(" ").filter(Boolean);
const MEASURED = 8; // [s]
const LONGEST = 60; // [s] until it is felt

test.skipIf(!wanted.length)(
  "measures how quickly the page draws and answers",
  async () => {
    const browser = await launch();
    try {
      for (const source of wanted) {
        const isFile = existsSync(source);
        const program = await Program.start(["--camera", isFile ? "synthetic:plane" : source]);
        const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
        let began = performance.now();
        const since = () => ((performance.now() - began) / 1000).toFixed(1);
        await page.goto(program.url);
        await drawn(page);
        if (isFile) {
          const before = await page.locator("#camera").textContent();
          began = performance.now();
          await page.setInputFiles("#file", source);
          await page.waitForFunction(
            (before) => document.querySelector("#camera")!.textContent !== before,
            before,
          );
          await drawn(page);
        }
        const seen = since();
        const at = await pressDown(page);
        const isFelt = async () => (await glimpse(page)).force > 0.1;
        while (!(await isFelt()) && Number(since()) < LONGEST) await page.waitForTimeout(50);
        const felt = since();
        const rate = async (doing: () => Promise<void>) => {
          const { drawings } = await glimpse(page);
          const start = performance.now();
          while (performance.now() < start + 1000 * MEASURED) await doing();
          const seconds = (performance.now() - start) / 1000;
          return (((await glimpse(page)).drawings - drawings) / seconds).toFixed(1);
        };
        await rate(() => page.waitForTimeout(100)); // it finds how finely it can draw
        const pressing = await rate(() => page.waitForTimeout(100));
        let angle = 0;
        const sliding = await rate(async () => {
          angle += 0.2;
          await page.mouse.move(at.x + 30 * Math.sin(angle), at.y + 10 * Math.cos(angle));
          await page.waitForTimeout(30);
        });
        const { points } = await glimpse(page);
        console.log(
          `${source}: drawn after ${seen} s, felt after ${felt} s; ` +
            `${pressing} images/s pressing, ${sliding} sliding, of ${points} points`,
        );
        await page.close();
        await program.stop();
      }
    } finally {
      await browser.close();
    }
  },
  900_000,
);
