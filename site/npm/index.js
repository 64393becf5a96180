// SPDX-License-Identifier: Apache-2.0
// See index.d.ts.

const numbers = (count) => Array(count).fill("number");

// In Node the files are read, elsewhere fetched: emscripten's own loader takes Node for a browser.
async function bytesOf(name) {
  const url = new URL(name, import.meta.url);
  if (url.protocol !== "file:") return new Uint8Array(await (await fetch(url)).arrayBuffer());
  return (await import("node:fs/promises")).readFile(url);
}

async function core(post) {
  const [code, wasmBinary] = await Promise.all(
    ["palpate-core.js", "palpate-core.wasm"].map(bytesOf),
  );
  const isNode = typeof process === "object" && import.meta.url.startsWith("file:");
  const need = isNode ? (await import("node:module")).createRequire(import.meta.url) : undefined;
  const text = new TextDecoder().decode(code);
  const make = new Function("require", "__dirname", `${text}\nreturn palpateCore;`);
  return make(need, ".")({ wasmBinary, post });
}

export class Session {
  static async open(scene, { onMessage = () => {} } = {}) {
    const session = new Session();
    let refusal = null;
    session.module = await core((data) => {
      if (typeof data === "string" && data.startsWith('{"error"')) refusal = JSON.parse(data).error;
      onMessage(data);
    });
    session.module.ccall("palpate_open", null, ["string", "number"], [scene, 0]);
    if (refusal) throw new Error(refusal);
    return session;
  }

  hand(place) {
    this.module.ccall("palpate_hand", null, numbers(4), [1, ...place]);
  }

  release() {
    this.module.ccall("palpate_hand", null, numbers(4), [0, 0, 0, 0]);
  }

  advance(t) {
    this.module.ccall("palpate_advance", null, numbers(1), [t]);
    return this.module.palpateTick();
  }

  command(what) {
    this.module.ccall("palpate_command", null, ["string"], [JSON.stringify(what)]);
  }

  file(name, bytes) {
    this.module.palpateTakeFile(name, bytes);
  }
}
