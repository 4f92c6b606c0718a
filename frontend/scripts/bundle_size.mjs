// Prints the participant bundle's size, gzipped, and fails above the budget of docs/participant.md.
import { readdirSync, readFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const BUDGET_BYTES = 100 * 1024;
const folder = new URL("../dist/participant/", import.meta.url);
const sizes = readdirSync(folder).map((name) => [name, gzipSync(readFileSync(new URL(name, folder)), { level: 9 }).length]);
const total = sizes.reduce((sum, [, bytes]) => sum + bytes, 0);

for (const [name, bytes] of sizes) console.log(`${String(bytes).padStart(7)}  ${name}`);
console.log(`${String(total).padStart(7)}  participant bundle, gzipped; budget ${BUDGET_BYTES}`);
if (total > BUDGET_BYTES) {
  console.error(`error: expected at most ${BUDGET_BYTES} bytes gzipped, got ${total}; find what grew`);
  process.exit(1);
}
