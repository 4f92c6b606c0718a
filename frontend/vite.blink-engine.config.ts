import { defineConfig } from "vite";

// The package `blink-engine`: one module without dependencies (scripts/blink_engine_package.mjs writes the rest).
export default defineConfig({
  build: {
    outDir: "dist/blink-engine",
    emptyOutDir: true,
    rolldownOptions: { checks: { bundlerTimings: false } },
    target: "es2022",
    lib: { entry: "src/blink-engine/index.ts", formats: ["es"], fileName: () => "index.js" },
  },
});
