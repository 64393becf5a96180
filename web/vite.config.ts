// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from "vitest/config";

// Three files with fixed names: the program carries them inside itself.
export default defineConfig({
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
});
