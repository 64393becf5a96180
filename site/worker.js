// SPDX-License-Identifier: Apache-2.0
// The Worker of a page without a server: it owns session, clock and files, and speaks the protocol
// of docs/protocol.md by messages. Part of the module that emscripten makes, whose optimiser of
// 2022 knows no declaration that takes an object apart.
/* global Module, FS */

const TICKS_INTERVAL = 4; // [ms] no timer of a browser is faster: several ticks run at once

const palpateSeconds = () => performance.now() / 1000;
const palpatePost = (data) => postMessage(data, data instanceof ArrayBuffer ? [data] : []);
const palpateCall = (name, types, ...values) => Module.ccall(name, null, types, values);

const palpateTake = (message) => {
  if (typeof message === "string") return palpateCall("palpate_command", ["string"], message);
  if (message instanceof ArrayBuffer) {
    const bytes = new Uint8Array(message);
    return palpateCall("palpate_take", ["array", "number"], bytes, bytes.length);
  }
  if (message.open) {
    return palpateCall("palpate_open", ["string", "number"], message.open, palpateSeconds());
  }
  const of = ["string", "number"];
  const sent = [message.name, message.bytes.length];
  const path = Module.ccall("palpate_begin_file", "string", of, sent);
  if (!path) return;
  FS.writeFile(path, message.bytes, { canOwn: true });
  palpateCall("palpate_end_file", ["string"], path);
};

if (typeof importScripts === "function") {
  const early = []; // what comes before the module is there
  self.onmessage = ({ data }) => early.push(data);
  Module.onRuntimeInitialized = () => {
    self.onmessage = ({ data }) => palpateTake(data);
    early.forEach(palpateTake);
    setInterval(() => palpateCall("palpate_advance", ["number"], palpateSeconds()), TICKS_INTERVAL);
  };
}
