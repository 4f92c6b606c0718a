import react from "@vitejs/plugin-react";
import { defineConfig } from "vite";

// The server answers /assets/admin/NAME with dist/admin/NAME, and every /admin/... with its index.html.
export default defineConfig({
  root: "src/admin",
  base: "/assets/admin/",
  plugins: [react()],
  build: {
    outDir: "../../dist/admin",
    emptyOutDir: true,
    rolldownOptions: { checks: { bundlerTimings: false } },
    assetsDir: "",
    assetsInlineLimit: 0,
    target: "es2022",
    modulePreload: { polyfill: false },
    sourcemap: false,
    manifest: true,
  },
});
