// SPDX-License-Identifier: Apache-2.0
// Takes the pictures of the page of scripts/screenshot.

import { writeFileSync } from "node:fs";
import { test } from "vitest";
import { drawn, glimpse, launch, placeWhere, Program } from "./session";
import { animatedWebp } from "./webp";

const folder = process.env.PALPATE_PICTURES;

test.skipIf(!folder)(
  "takes the pictures",
  async () => {
    const browser = await launch();
    const program = await Program.start(["--camera", "synthetic:desk"]);
    try {
      for (const { name, width, height, colorScheme, tab } of [
        { name: "page-dark", width: 1440, height: 900, colorScheme: "dark", tab: "Touch" },
        { name: "page-light", width: 1440, height: 900, colorScheme: "light", tab: "Method" },
        { name: "page-phone", width: 360, height: 740, colorScheme: "dark", tab: "Touch" },
      ] as const) {
        const page = await browser.newPage({ viewport: { width, height }, colorScheme });
        await page.goto(program.url);
        await drawn(page);
        // All points, however long the drawing takes here.
        await page.evaluate(() => {
          const { view } = (window as any).palpate;
          Object.assign(view.thinning, { level: 0, measure() {} });
          view.setOrbit({ ...view.orbit, distance: 0.62 * view.orbit.distance });
        });
        if (tab !== "Touch") await page.getByRole("tab", { name: tab }).click();
        const x = 0.35 * width;
        const y = 0.3 * height;
        await page.mouse.move(x, y);
        await page.mouse.down();
        // Onto the desk, and a stroke over it.
        for (let i = 0; i < 60 && (await glimpse(page)).state === 0; ++i)
          await page.waitForTimeout(100);
        await page.waitForTimeout(2500); // the force ramps up
        for (let i = 1; i <= 40; ++i) {
          await page.mouse.move(x + (0.1 * width * i) / 40, y - 10 * Math.sin(i / 6));
          await page.waitForTimeout(60);
        }
        await page.waitForTimeout(2500);
        await page.screenshot({ path: `${folder}/${name}.png` });
        await page.mouse.up();
        await page.close();
      }
    } finally {
      await browser.close();
      await program.stop();
    }
  },
  300_000,
);

test.skipIf(!folder)(
  "takes the moving picture of a person who presses and slides",
  async () => {
    const browser = await launch();
    const program = await Program.start(["--camera", "synthetic:desk"]);
    try {
      const [width, height] = [896, 560];
      const page = await browser.newPage({ viewport: { width, height }, colorScheme: "dark" });
      await page.goto(program.url);
      await drawn(page);
      await page.evaluate(() => {
        const { view } = (window as any).palpate;
        Object.assign(view.thinning, { level: 2, measure() {} });
        // Pictures of a page show no pointer.
        const pointer = document.createElement("div");
        pointer.style.cssText =
          "position:fixed;z-index:9;width:18px;height:18px;margin:-9px;border-radius:50%;" +
          "border:2px solid white;pointer-events:none";
        document.body.append(pointer);
        addEventListener("pointermove", ({ clientX, clientY, buttons }) => {
          Object.assign(pointer.style, {
            left: `${clientX}px`,
            top: `${clientY}px`,
            background: buttons ? "#fff8" : "none",
          });
        });
      });
      const pngs: Buffer[] = [];
      const shoot = async () => pngs.push(await page.screenshot());
      const from = await placeWhere(page, "surface");
      const move = async (x: number, y: number) => {
        await page.mouse.move(x, y);
        await shoot();
      };
      for (let i = 4; i >= 0; --i) await move(from.x - 16 * i, from.y - 10 * i);
      await page.mouse.down();
      await page.mouse.move(from.x + 1, from.y);
      for (let i = 0; i < 14; ++i) await shoot();
      for (let i = 1; i <= 22; ++i)
        await move(from.x + 7 * i, from.y + 26 * Math.sin(i / 4));
      await page.mouse.up();
      for (let i = 0; i < 3; ++i) await shoot();
      const size = { width: 768, height: 480, pause: 110, quality: 0.55 };
      writeFileSync(`${folder}/pressing.webp`, await animatedWebp(page, pngs, size));
    } finally {
      await browser.close();
      await program.stop();
    }
  },
  300_000,
);
