import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { defineConfig, type Plugin } from "vite";

const BASE = "/assets/participant/";
const OFFLINE = "service-worker";
/** Short: the names appear in the page and in the service worker, gzipped badly. What loads later goes by its hash alone. */
const NAMED = "[name]-[hash:6].js";
const LATER = "[hash:6].js";
/** What every kind of trial and the other pages need. */
const SHARED =
  /src\/ui\/|participant\/(session|request|screens\/support|jspsych|playback\/(protocol|record)|views\/|trials\/(rating|showing|trial)\.)/;

/** Gives the service worker the names of the built files, which it keeps. */
function listFiles(): Plugin {
  return {
    name: "list-files",
    // Last: Vite takes away the scripts of modules that are styles alone, and one missing file keeps the worker from installing.
    enforce: "post",
    generateBundle: {
      order: "post",
      handler(_options, bundle) {
        const files = Object.keys(bundle).filter((name) => /\.(js|css)$/.test(name) && name !== `${OFFLINE}.js`);
        const worker = bundle[`${OFFLINE}.js`];
        if (worker?.type !== "chunk") throw new Error(`expected ${OFFLINE}.js in the bundle`);
        worker.code = worker.code.replaceAll("__FILES__", JSON.stringify(files.map((name) => BASE + name)));
      },
    },
    writeBundle({ dir = "" }) {
      const worker = readFileSync(resolve(dir, `${OFFLINE}.js`), "utf8");
      const named = [...worker.matchAll(/\/assets\/participant\/([\w.-]+)/g)].map((match) => match[1] ?? "");
      const missing = named.filter((name) => !existsSync(resolve(dir, name)));
      if (named.length === 0 || missing.length > 0)
        throw new Error(`the service worker names files that are not built: ${missing.join(", ")}`);
    },
  };
}

/** Takes comments and indentation from the script for old browsers, which is copied as it is and loaded by everybody. */
function shortenBootCheck(): Plugin {
  return {
    name: "shorten-boot-check",
    writeBundle({ dir = "" }) {
      const file = resolve(dir, "boot-check.js");
      writeFileSync(file, readFileSync(file, "utf8").replace(/^\s*(\/\/.*\n\s*)?/gm, ""));
    },
  };
}

// The server answers /assets/participant/NAME with dist/participant/NAME, and /run/TOKEN with its index.html.
export default defineConfig({
  root: "src/participant",
  base: BASE,
  publicDir: "public",
  plugins: [listFiles(), shortenBootCheck()],
  build: {
    outDir: "../../dist/participant",
    emptyOutDir: true,
    assetsDir: "",
    assetsInlineLimit: 0,
    target: "es2022",
    modulePreload: { polyfill: false },
    sourcemap: false,
    manifest: true,
    rolldownOptions: {
      checks: { bundlerTimings: false },
      input: { index: "src/participant/index.html", [OFFLINE]: "src/participant/service-worker.ts" },
      output: {
        entryFileNames: ({ name }) => (name === OFFLINE ? "[name].js" : NAMED),
        chunkFileNames: LATER,
        assetFileNames: "[name]-[hash:6][extname]",
        // By default, every module that two pages share becomes a separate file, and small files compress badly.
        codeSplitting: { groups: [{ name: "base", test: SHARED }] },
      },
    },
  },
  // Notes for the bundler, which has read them.
  worker: { format: "es", rolldownOptions: { output: { comments: false } } },
});
