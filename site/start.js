// SPDX-License-Identifier: Apache-2.0
// After the module: a Worker runs it; who imports it calls `palpateCore` (npm/index.mjs).
/* global palpateCore */
if (typeof importScripts === "function") palpateCore();
