// SPDX-License-Identifier: Apache-2.0
// Keeps the page for when there is no network: what the network gives is newer, and kept.

const NAME = "palpate";
const SCRIPTS = ["palpate.js", "palpate-core.js", "palpate-core.wasm"];
const FILES = ["./", "index.html", "palpate.css", ...SCRIPTS];

self.addEventListener("install", (event) => {
  self.skipWaiting();
  event.waitUntil(caches.open(NAME).then((cache) => cache.addAll(FILES)));
});
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));
self.addEventListener("fetch", (event) => {
  const isOurs = new URL(event.request.url).origin === location.origin;
  if (event.request.method !== "GET" || !isOurs) return;
  const fresh = fetch(event.request).then(async (answer) => {
    if (answer.ok) await (await caches.open(NAME)).put(event.request, answer.clone());
    return answer;
  });
  const kept = () => caches.match(event.request, { ignoreSearch: true });
  event.respondWith(fresh.catch(async () => (await kept()) || Response.error()));
});
