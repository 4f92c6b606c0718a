import { defineConfig } from "vite";

// The driver runs outside this folder, so it carries its packages with it.
export default defineConfig({ ssr: { noExternal: true } });
