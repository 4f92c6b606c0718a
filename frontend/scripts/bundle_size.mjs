// Prints what a page loads at first, gzipped, and fails above its budget: `node bundle_size.mjs participant | admin`.
// The participant's page counts whole, but of the kinds of trial and of the languages, which load on demand, the
// largest; the admin site counts the entry and the largest page, whose parts load when they are first opened.
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const BUDGETS = { participant: 100 * 1024, admin: 400 * 1024 };
const site = process.argv[2] ?? "participant";
const budget = BUDGETS[site];
if (budget === undefined) {
  console.error(`error: expected participant or admin, got ${site}`);
  process.exit(2);
}
const folder = new URL(`../dist/${site}/`, import.meta.url);
const bytesOf = (name) => gzipSync(readFileSync(new URL(name, folder)), { level: 9 }).length;
const sum = (names) => [...names].reduce((total, name) => total + bytesOf(name), 0);

/** What `start` loads, by the manifest: its file, styles and everything it imports, but no page opened later. */
function filesOf(manifest, start, found = new Set()) {
  const { file, css = [], imports = [] } = manifest[start];
  if (found.has(file)) return found;
  for (const name of [file, ...css]) found.add(name);
  for (const name of imports) filesOf(manifest, name, found);
  return found;
}

function report(total, what) {
  console.log(`${String(total).padStart(7)}  ${what}, gzipped; budget ${budget}`);
  if (total <= budget) return;
  console.error(`error: expected at most ${budget} bytes gzipped, got ${total}: ${what}; find what grew`);
  process.exitCode = 1;
}

const manifestFile = new URL(".vite/manifest.json", folder);
if (site === "participant") {
  const names = readdirSync(folder, { withFileTypes: true }).filter((entry) => entry.isFile());
  for (const { name } of names) console.log(`${String(bytesOf(name)).padStart(7)}  ${name}`);
  const trials = new URL("../src/participant/trials/", import.meta.url);
  const kinds = readdirSync(trials).filter((name) => existsSync(new URL(`${name}/index.ts`, trials)));
  const kindOf = (file) => kinds.find((kind) => file.startsWith(`${kind}-`)) ?? null;
  // What only some kinds share counts with each of them; the fallback for browsers without the worker not at all.
  const textOf = (name) => readFileSync(new URL(name, folder), "utf8");
  const importsOf = (name) => [...textOf(name).matchAll(/from\s*"\.\/([^"]+\.js)"/g)].map(([, file]) => file.replace(/-.{8}\.js$/, ""));
  const entry = names.map(({ name }) => name).find((name) => /^index-.{8}\.js$/.test(name));
  const mainOf = (kind) => names.map(({ name }) => name).find((name) => name.startsWith(`${kind}-`) && name.endsWith(".js"));
  const stemsOf = (kind) =>
    (mainOf(kind) ? importsOf(mainOf(kind)) : []).filter((stem) => stem !== "index" && !importsOf(entry).includes(stem));
  const common = (stem) => kinds.every((kind) => stemsOf(kind).includes(stem));
  const shared = [...new Set(kinds.flatMap(stemsOf))].filter((stem) => !common(stem));
  const sharedOf = (name) => shared.find((stem) => name.startsWith(`${stem}-`)) ?? null;
  const filesOfKind = (kind) =>
    names
      .map(({ name }) => name)
      .filter((name) => !name.startsWith("video-player-"))
      .filter((name) => (sharedOf(name) ? kind !== null && stemsOf(kind).includes(sharedOf(name)) : kindOf(name) === kind));
  const total = (kind) => sum(filesOfKind(kind));
  const languages = readdirSync(new URL("../src/i18n/languages/", import.meta.url)).map((name) => name.replace(/\.ts$/, ""));
  const ofLanguages = names.map(({ name }) => name).filter((name) => languages.some((tag) => new RegExp(`^${tag}-.{8}\\.js$`).test(name)));
  if (ofLanguages.length !== languages.length) {
    console.error(`error: expected a file for each of ${languages.join(", ")} in dist/participant, found ${ofLanguages.join(", ")}`);
    process.exitCode = 1;
  }
  // Who reads the study in one language loads one; a second only where the browser's own is not among the study's.
  const apart = sum(ofLanguages) - Math.max(...ofLanguages.map(bytesOf));
  for (const kind of kinds.filter((one) => filesOfKind(one).length === 0)) {
    console.error(`error: expected a file of the kind ${kind} in dist/participant, found none; build the page again`);
    process.exitCode = 1;
  }
  report(total(null) - apart + Math.max(...kinds.map(total)), "participant bundle with the largest kind of trial and language");
} else if (!existsSync(manifestFile)) {
  console.error("error: expected dist/admin/.vite/manifest.json; build the site first");
  process.exitCode = 1;
} else {
  const manifest = JSON.parse(readFileSync(manifestFile, "utf8"));
  const entry = Object.keys(manifest).find((name) => manifest[name].isEntry);
  const first = filesOf(manifest, entry);
  const pages = (manifest[entry].dynamicImports ?? []).map((name) => {
    const files = filesOf(manifest, name, new Set(first));
    return [sum(files), name];
  });
  for (const [bytes, name] of pages.sort(([a], [b]) => b - a).slice(0, 5)) console.log(`${String(bytes).padStart(7)}  with ${name}`);
  report(sum(first), "admin site, before any page");
  report(Math.max(...pages.map(([bytes]) => bytes)), "admin site, first load of the largest page");
}
