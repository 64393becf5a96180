// SPDX-License-Identifier: Apache-2.0
// Takes the pictures of the page of scripts/screenshot.

import { test } from "vitest";
import { drawn, glimpse, launch, Program } from "./session";

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
