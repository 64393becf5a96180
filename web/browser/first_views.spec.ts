// SPDX-License-Identifier: Apache-2.0
// Takes the contact sheet of scripts/first_views: what the page shows of each source at first.

import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "vitest";
import { launch, Program } from "./session";

/** Lines `URI`, or `URI CAPTION`. */
const wanted = (process.env.PALPATE_FIRST_VIEWS ?? "").split("\n").filter(Boolean);
const sheet = process.env.PALPATE_SHEET;
const [width, height] = [1280, 800];
const shown = { x: 0, y: 52, width: 928, height: 696 }; // what the panel leaves free

test.skipIf(!sheet)(
  "takes the first views",
  async () => {
    const browser = await launch();
    const folder = mkdtempSync(join(tmpdir(), "first-views-"));
    try {
      const pictures: string[] = [];
      for (const line of wanted) {
        const [uri, caption] = [line.split(" ")[0]!, line.split(" ").slice(1).join(" ")];
        const program = await Program.start(["--camera", uri], 0, folder);
        const page = await browser.newPage({ viewport: { width, height }, colorScheme: "dark" });
        await page.goto(program.url);
        await page.waitForFunction(() => {
          const { view } = (window as any).palpate ?? {};
          if (!view?.frames) return false;
          Object.assign(view.thinning, { level: 0, measure() {} }); // all points
          return view.drawings > 4;
        });
        await page.addStyleTag({ content: ".hud, .hint, .legend { display: none }" });
        await page.evaluate(() => (window as any).palpate.view.touch());
        await page.waitForTimeout(1500);
        const picture = await page.screenshot({ clip: shown });
        pictures.push(
          `<figure><img src="data:image/png;base64,${picture.toString("base64")}">` +
            `<figcaption>${caption || uri}</figcaption></figure>`,
        );
        await page.close();
        await program.stop();
      }
      const page = await browser.newPage({ viewport: { width: 1240, height: 300 } });
      await page.setContent(
        `<style>
           body { margin: 8px; display: grid; grid-template-columns: repeat(4, 1fr); gap: 8px;
                  background: #0d1117; color: #c9d1d9; font: 13px sans-serif }
           figure { margin: 0 } img { width: 100%; border-radius: 6px }
         </style>${pictures.join("")}`,
      );
      await page.screenshot({ path: sheet!, fullPage: true, type: "jpeg", quality: 80 });
    } finally {
      await browser.close();
      rmSync(folder, { recursive: true });
    }
  },
  900_000,
);
