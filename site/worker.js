// SPDX-License-Identifier: Apache-2.0
// The Worker of a page without a server: it owns session, clock and files, and speaks the protocol
// of docs/protocol.md by messages. Part of the module that emscripten makes, whose optimiser of
// 2022 knows no declaration that takes an object apart.
/* global Module, FS, HEAPF64, fflate, fzstd, palpateInverse3 */

const TICKS_INTERVAL = 4; // [ms] no timer of a browser is faster: several ticks run at once

const isWorker = typeof importScripts === "function";
const palpateSeconds = () => performance.now() / 1000;
// Who imports the module gives it `post`, and gets messages and files there.
const palpateSend = (data, given) => (isWorker ? postMessage(data, given) : Module.post(data));
const palpatePost = (data) => palpateSend(data, data instanceof ArrayBuffer ? [data] : []);
const palpatePostFile = (path) => {
  const bytes = FS.readFile(path);
  palpateSend({ name: path.split("/").pop(), bytes }, [bytes.buffer]);
};
const palpateCall = (name, types, ...values) => Module.ccall(name, null, types, values);
// The newest tick: places [m, world], normal and force [N, world], and the state.
const palpateTick = () => {
  const at = Module.ccall("palpate_tick", "number", [], []) / 8;
  const vector = (i) => Array.from(HEAPF64.subarray(at + 3 * i, at + 3 * i + 3));
  return {
    hip: vector(0),
    proxy: vector(1),
    normal: vector(2),
    force: vector(3),
    state: HEAPF64[at + 12],
    t: HEAPF64[at + 13],
  };
};
Module.palpateTick = palpateTick;
// What bytes are made of, within `room` bytes where that is known to be too little otherwise.
const palpateConvert = {
  unzstd: (bytes) => fzstd.decompress(bytes),
  unzlib: (bytes, room) => fflate.unzlibSync(bytes, { out: new Uint8Array(room) }),
  gunzip: (bytes) => fflate.gunzipSync(bytes),
  zlib: (bytes) => fflate.zlibSync(bytes, { level: 1 }),
};

// A zip of images becomes a folder: what lies in its only folder, if there is one.
const palpateUnzip = (path, bytes) => {
  const files = fflate.unzipSync(bytes);
  const names = Object.keys(files).filter((name) => !name.endsWith("/"));
  const first = (names[0] || "").split("/")[0] + "/";
  const skipped = names.every((name) => name.startsWith(first)) ? first.length : 0;
  for (const name of names) {
    const parts = name.slice(skipped).split("/");
    if (parts.includes("..")) throw new Error("it names files outside itself");
    FS.mkdirTree([path].concat(parts.slice(0, -1)).join("/"));
    FS.writeFile([path].concat(parts).join("/"), files[name], { canOwn: true });
  }
};

Module.palpateTakeFile = (name, bytes) => palpateTakeFile(name, bytes);
const palpateTakeFile = (name, bytes) => {
  const path = Module.ccall("palpate_begin_file", "string", ["string", "number"], [
    name,
    bytes.length,
  ]);
  if (!path) return;
  try {
    if (name.endsWith(".zip")) palpateUnzip(path, bytes);
    else FS.writeFile(path, bytes, { canOwn: true });
  } catch (error) {
    const why = `${name}: it cannot be unpacked: ${error.message}; download it again`;
    return palpatePost(JSON.stringify({ error: why }));
  }
  palpateCall("palpate_end_file", ["string"], path);
};

const palpateTake = (message) => {
  if (typeof message === "string") return palpateCall("palpate_command", ["string"], message);
  if (message instanceof ArrayBuffer) {
    const bytes = new Uint8Array(message);
    return palpateCall("palpate_take", ["array", "number"], bytes, bytes.length);
  }
  if (message.open) {
    return palpateCall("palpate_open", ["string", "number"], message.open, palpateSeconds());
  }
  if (message.depth) {
    const of = message.depth;
    const bytes = (numbers) => new Uint8Array(numbers.buffer);
    const types = ["number", "number", "array", "array", "array", "number"];
    const [depth, camera, pose] = [of.depth, of.camera, of.pose].map(bytes);
    const now = palpateSeconds();
    return palpateCall("palpate_depth", types, of.width, of.height, depth, camera, pose, now);
  }
  if (message.splat) return palpateCall("palpate_splat", []);
  if (message.inverse3 !== undefined) return palpateInverse3.lead(message.inverse3);
  palpateTakeFile(message.name, message.bytes);
};

if (isWorker) {
  const early = []; // what comes before the module is there
  self.onmessage = ({ data }) => early.push(data);
  Module.onRuntimeInitialized = () => {
    self.onmessage = ({ data }) => palpateTake(data);
    early.forEach(palpateTake);
    setInterval(() => palpateCall("palpate_advance", ["number"], palpateSeconds()), TICKS_INTERVAL);
  };
}
