// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from "vitest/config";

// Three files with fixed names: the program carries them inside itself. In mode `site` they are a
// page without a server, which differs in one module.
export default defineConfig(({ mode }) => ({
  base: mode === "site" ? "./" : "/",
  resolve: {
    alias: mode === "site" ? [{ find: "./connection", replacement: "./worker_connection" }] : [],
  },
  build: {
    target: "es2022",
    chunkSizeWarningLimit: 1024,
    modulePreload: { polyfill: false },
    rollupOptions: {
      output: {
        entryFileNames: "palpate.js",
        assetFileNames: "palpate.[ext]",
        inlineDynamicImports: true,
      },
    },
  },
  test: { include: ["tests/*.test.ts"] },
}));
