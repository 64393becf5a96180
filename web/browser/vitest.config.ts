// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from "vitest/config";

export default defineConfig({
  test: {
    include: ["browser/*.spec.ts"],
    testTimeout: 300_000, // a browser that draws in software, on a busy machine
    expect: { poll: { timeout: 120_000 } },
    hookTimeout: 60_000,
    fileParallelism: false,
  },
});
