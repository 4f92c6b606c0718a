import { defineConfig } from "vite";

// One script and one style sheet, which addon_build/playground.py puts into a page that opens from a folder.
export default defineConfig({
  build: {
    outDir: "dist/playground",
    emptyOutDir: true,
    rolldownOptions: { checks: { bundlerTimings: false } },
    target: "es2022",
    cssCodeSplit: false,
    lib: {
      entry: "src/playground/main.ts",
      formats: ["iife"],
      name: "playground",
      fileName: () => "playground.js",
      cssFileName: "playground",
    },
  },
});
