// Completes dist/blink-engine as a package that npm can pack: types, package.json, README, licence. Prints its size and speed.
import { execFileSync } from "node:child_process";
import { copyFileSync, readFileSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const BUDGET = 15 * 1024;
const root = new URL("..", import.meta.url);
const folder = new URL("dist/blink-engine/", root);
const { version, license } = JSON.parse(readFileSync(new URL("package.json", root), "utf8"));

const types = ["--declaration", "--emitDeclarationOnly", "--noEmit", "false", "--outDir", "dist/blink-engine/types", "--rootDir", ".."];
execFileSync(process.execPath, ["node_modules/typescript-7/bin/tsc", "-p", "tsconfig.blink-engine.json", ...types], {
  cwd: root,
  stdio: "inherit",
});
writeFileSync(
  new URL("package.json", folder),
  `${JSON.stringify(
    {
      name: "blink-engine",
      version,
      description: "Natural blinks for avatars: a seeded stream of lid curves",
      license,
      type: "module",
      sideEffects: false,
      exports: { ".": { types: "./types/frontend/src/blink-engine/index.d.ts", default: "./index.js" } },
      files: ["index.js", "types"],
    },
    null,
    2,
  )}\n`,
);
copyFileSync(new URL("../LICENSE", root), new URL("LICENSE", folder));
copyFileSync(new URL("../docs/explanation/blink-engine.md", root), new URL("README.md", folder));

const bytes = gzipSync(readFileSync(new URL("index.js", folder)), { level: 9 }).length;
console.log(`${String(bytes).padStart(7)}  blink-engine, gzipped; budget ${BUDGET}`);
if (bytes > BUDGET) {
  console.error(`error: expected at most ${BUDGET} bytes gzipped, got ${bytes}`);
  process.exitCode = 1;
}

const { BlinkEngine } = await import(new URL("index.js", folder).href);
const FRAMES = 2_000_000;
const engine = new BlinkEngine({ seed: 1, state: "speaking" });
const begun = process.cpuUsage();
for (let frame = 0; frame < FRAMES; frame += 1) engine.frame(frame / 60);
const { user, system } = process.cpuUsage(begun);
console.log(`${((user + system) / FRAMES).toFixed(3).padStart(7)}  microseconds a frame`);
