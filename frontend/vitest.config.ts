import { defineConfig } from "vitest/config";

// No test is about time: what a busy machine slows down must not fail by it.
const LONGEST_MS = 60_000;

export default defineConfig({
  test: { include: ["tests/**/*.test.ts"], environment: "node", restoreMocks: true, testTimeout: LONGEST_MS },
});
