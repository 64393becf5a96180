// SPDX-License-Identifier: Apache-2.0
// Still pictures as an animated WebP: the browser compresses each, here they are put in one file
// (RIFF container: https://developers.google.com/speed/webp/docs/riff_container).

import type { Page } from "playwright-core";

function chunk(name: string, content: Buffer): Buffer {
  const head = Buffer.alloc(8);
  head.write(name, "latin1");
  head.writeUInt32LE(content.length, 4);
  return Buffer.concat([head, content, Buffer.alloc(content.length % 2)]);
}

/** A picture's own chunk of a still WebP, VP8 without alpha. */
function stillOf(webp: Buffer): Buffer {
  for (let at = 12; at < webp.length; ) {
    const size = webp.readUInt32LE(at + 4);
    if (webp.toString("latin1", at, at + 4) === "VP8 ") return webp.subarray(at, at + 8 + size);
    at += 8 + size + (size % 2);
  }
  throw new Error("the browser made a WebP of another kind");
}

/** @param pngs all of one size  @param pause [ms] between two  @param quality 0 to 1 */
export async function animatedWebp(
  page: Page,
  pngs: readonly Buffer[],
  { width, height, pause, quality }: Record<"width" | "height" | "pause" | "quality", number>,
): Promise<Buffer> {
  const frames: Buffer[] = [];
  for (const png of pngs) {
    const url = await page.evaluate(
      async ({ source, width, height, quality }) => {
        const image = new Image();
        image.src = source;
        await image.decode();
        const canvas = Object.assign(document.createElement("canvas"), { width, height });
        canvas.getContext("2d", { alpha: false })!.drawImage(image, 0, 0, width, height);
        return canvas.toDataURL("image/webp", quality);
      },
      { source: `data:image/png;base64,${png.toString("base64")}`, width, height, quality },
    );
    const place = Buffer.alloc(16); // x, y, then size, pause and flags
    place.writeUIntLE(width - 1, 6, 3);
    place.writeUIntLE(height - 1, 9, 3);
    place.writeUIntLE(pause, 12, 3);
    place.writeUInt8(2, 15); // not blended with the one before
    const still = stillOf(Buffer.from(url.split(",")[1]!, "base64"));
    frames.push(chunk("ANMF", Buffer.concat([place, still, Buffer.alloc(still.length % 2)])));
  }
  const about = Buffer.alloc(10);
  about.writeUInt8(2); // animated
  about.writeUIntLE(width - 1, 4, 3);
  about.writeUIntLE(height - 1, 7, 3);
  const forEver = Buffer.alloc(6);
  const body = [Buffer.from("WEBP"), chunk("VP8X", about), chunk("ANIM", forEver), ...frames];
  return chunk("RIFF", Buffer.concat(body));
}
