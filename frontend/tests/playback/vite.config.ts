import { defineConfig } from "vite";

export default defineConfig({
  build: {
    target: "es2022",
    rolldownOptions: { checks: { bundlerTimings: false } },
    lib: { entry: "tests/playback/page.ts", formats: ["es"], fileName: () => "page.js" },
  },
});
