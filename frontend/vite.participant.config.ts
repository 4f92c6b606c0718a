import { defineConfig } from "vite";

// The server answers /assets/participant/NAME with dist/participant/NAME, and /run/TOKEN with its index.html.
export default defineConfig({
  root: "src/participant",
  base: "/assets/participant/",
  publicDir: "public",
  build: {
    outDir: "../../dist/participant",
    emptyOutDir: true,
    assetsDir: "",
    assetsInlineLimit: 0,
    target: "es2022",
    modulePreload: { polyfill: false },
    sourcemap: false,
  },
  worker: { format: "es" },
});
