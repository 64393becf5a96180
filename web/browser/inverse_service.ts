// SPDX-License-Identifier: Apache-2.0
// A simulated Inverse Service of Haply's, for tests.

import { createHash } from "node:crypto";
import { createServer } from "node:http";
import type { AddressInfo } from "node:net";

/** Haply's service with one device, which is pushed down: what it was sent, and by whom. */
export class InverseService {
  forces: number[][] = [];
  address = "";
  private height = 0.1; // [m]
  private readonly server = createServer();

  async start(): Promise<this> {
    this.server.on("upgrade", (request, socket) => {
      const magic = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
      const key = request.headers["sec-websocket-key"] + magic;
      const accept = createHash("sha1").update(key).digest("base64");
      socket.write(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n" +
          `Sec-WebSocket-Accept: ${accept}\r\n\r\n`,
      );
      const say = () => {
        const text = Buffer.from(JSON.stringify(this.state()));
        const size = text.length < 126 ? [text.length] : [126, text.length >> 8, text.length & 255];
        const head = Buffer.from([0x81, ...size]);
        socket.write(Buffer.concat([head, text]));
      };
      let rest = Buffer.alloc(0);
      socket.on("data", (bytes: Buffer) => {
        rest = Buffer.concat([rest, bytes]);
        for (;;) {
          const long = (rest[1]! & 127) === 126;
          const head = long ? 8 : 6;
          if (rest.length < head) return;
          const size = long ? rest.readUInt16BE(2) : rest[1]! & 127;
          if (rest.length < head + size) return;
          const mask = rest.subarray(head - 4, head);
          const text = rest.subarray(head, head + size).map((byte, i) => byte ^ mask[i % 4]!);
          const isText = (rest[0]! & 15) === 1;
          rest = rest.subarray(head + size);
          if (!isText) continue;
          const { x, y, z } = JSON.parse(Buffer.from(text).toString()).inverse3[0].commands
            .set_cursor_force.values;
          this.forces.push([x, y, z]);
          this.height -= 5e-5; // [m] a message
          setTimeout(say, 2); // one answer for each message
        }
      });
      socket.on("error", () => {});
      say(); // it speaks first
    });
    await new Promise<void>((resolve) => this.server.listen(0, "127.0.0.1", resolve));
    this.address = `ws://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
    return this;
  }

  largest(): number {
    return Math.max(0, ...this.forces.map((force) => Math.hypot(...force)));
  }

  stop(): void {
    this.server.close();
    this.server.closeAllConnections();
  }

  private state(): object {
    // What is zero is left out.
    const state = { cursor_position: { z: this.height }, current_cursor_force: { z: 0.1 } };
    return { inverse3: [{ device_id: "049D", state }] };
  }
}
