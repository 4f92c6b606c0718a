import { defineConfig } from "vite";

// One script, which addon_build/playground.py puts into a page that opens from a folder.
export default defineConfig({
  build: {
    outDir: "dist/vrm",
    emptyOutDir: true,
    rolldownOptions: { checks: { bundlerTimings: false } },
    target: "es2022",
    chunkSizeWarningLimit: 2000,
    lib: { entry: "src/demos/vrm/main.ts", formats: ["iife"], name: "vrm", fileName: () => "vrm.js", cssFileName: "vrm" },
  },
});
