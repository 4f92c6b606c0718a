// Prints what a page loads at first, gzipped, and fails above its budget: `node bundle_size.mjs participant | admin`.
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const BUDGETS = { participant: 104 * 1024, admin: 256 * 1024 };
/** What one page of the admin site may add to the entry. */
const OWN_OF_PAGE = 120 * 1024;
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
function filesOf(manifest, start, reached = new Set()) {
  const { file, css = [], imports = [] } = manifest[start];
  if (reached.has(file)) return reached;
  for (const name of [file, ...css]) reached.add(name);
  for (const name of imports) filesOf(manifest, name, reached);
  return reached;
}

function report(total, what, most = budget) {
  console.log(`${String(total).padStart(7)}  ${what}, gzipped; budget ${most}`);
  if (total <= most) return;
  console.error(`error: expected at most ${most} bytes gzipped, got ${total}: ${what}; find what grew`);
  process.exitCode = 1;
}

/** Up to the first trial: the entry with what the browser starts beside it, one language, and the largest kind of trial. */
function participant(manifest) {
  const names = readdirSync(folder, { withFileTypes: true }).filter((entry) => entry.isFile());
  for (const { name } of names) console.log(`${String(bytesOf(name)).padStart(7)}  ${name}`);
  const beside = names
    .map(({ name }) => name)
    .filter((name) => /^(index\.html|boot-check\.js|service-worker\.js|worker-.*\.js)$/.test(name));
  const first = filesOf(manifest, "index.html", new Set(beside));
  const pages = manifest["index.html"].dynamicImports;
  const further = (page, loaded) => sum(filesOf(manifest, page, new Set(loaded))) - sum(loaded);
  const largest = (names, pattern, loaded, more = () => 0) =>
    Math.max(...names.filter((name) => pattern.test(name)).map((name) => further(name, loaded) + more(name)));
  /** The largest type of scale that a kind of trial loads before its first trial; none where it has none. */
  const scale = (kind) => {
    const parts = manifest[kind].dynamicImports ?? [];
    return Math.max(0, largest(parts, /^trials\/scales\//, filesOf(manifest, kind, new Set(first))));
  };
  const language = largest(pages, /\/languages\//, first);
  const kind = largest(pages, /^kinds\/[^/]+\/screen\.ts$/, first, scale);
  if (beside.length !== 4 || !Number.isFinite(language + kind)) {
    console.error("error: expected page, worker, service worker, languages and kinds in dist/participant; build the page again");
    process.exitCode = 1;
  }
  report(sum(first) + language + kind, "participant's page up to the first trial of the largest kind");
}

/** Names of the pages that stand inside a study's frame, and so load with it, by the router. */
function tabs() {
  const router = readFileSync(new URL("../src/admin/router.tsx", import.meta.url), "utf8");
  return [...router.matchAll(/\.\.\.tab,[^}]*?import\("[^"]*\/(\w+)"\)/g)].map(([, name]) => name);
}

/** The entry, and with the largest page; what a page loads once it is shown (charts, the builder's forms) is not counted. */
function admin(manifest) {
  const entry = Object.keys(manifest).find((name) => manifest[name].isEntry);
  const first = filesOf(manifest, entry);
  const frame = filesOf(manifest, "studies/StudyLayout.tsx", new Set(first));
  const inStudy = tabs();
  const isTab = (page) => inStudy.some((name) => new RegExp(`(^|\\W|_)${name}\\W`).test(page));
  const names = manifest[entry].dynamicImports ?? [];
  const pages = names.map((name) => [sum(filesOf(manifest, name, new Set(isTab(name) ? frame : first))), name]);
  for (const [bytes, name] of pages.sort(([a], [b]) => b - a).slice(0, 5)) console.log(`${String(bytes).padStart(7)}  with ${name}`);
  if (names.filter(isTab).length !== inStudy.length || inStudy.length === 0) {
    console.error(`error: expected the ${inStudy.length} tabs of a study among the pages, got ${names.filter(isTab).join(", ")}`);
    process.exitCode = 1;
  }
  const own = Math.max(...pages.map(([bytes]) => bytes)) - sum(first);
  report(own, "admin site, largest page of its own", OWN_OF_PAGE);
  report(sum(first), "admin site, before any page");
  report(Math.max(...pages.map(([bytes]) => bytes)), "admin site, first load of the largest page");
  checkStyles();
}

/** Fails unless src/admin/mantine.css imports the styles of exactly the components that the site uses. */
function checkStyles() {
  const classes = (text) => new Set(text.match(/\bm_[0-9a-f]{6,8}\b/g));
  const scripts = readdirSync(folder).filter((name) => name.endsWith(".js"));
  const used = classes(scripts.map((name) => readFileSync(new URL(name, folder), "utf8")).join("\n"));
  const sheets = new URL("../node_modules/@mantine/core/styles/", import.meta.url);
  const imported = readFileSync(new URL("../src/admin/mantine.css", import.meta.url), "utf8");
  for (const name of readdirSync(sheets).filter((one) => one.endsWith(".css") && !one.endsWith(".layer.css"))) {
    const own = [...classes(readFileSync(new URL(name, sheets), "utf8"))];
    const line = `@import "@mantine/core/styles/${name}";`;
    const [isUsed, isImported] = [own.length === 0 || own.some((one) => used.has(one)), imported.includes(line)];
    if (isUsed === isImported) continue;
    console.error(`error: expected src/admin/mantine.css ${isUsed ? "with" : "without"} ${line}, got it ${isUsed ? "without" : "with"}`);
    process.exitCode = 1;
  }
}

const manifestFile = new URL(".vite/manifest.json", folder);
if (existsSync(manifestFile)) {
  const manifest = JSON.parse(readFileSync(manifestFile, "utf8"));
  if (site === "participant") participant(manifest);
  else admin(manifest);
} else {
  console.error(`error: expected dist/${site}/.vite/manifest.json; build the site first`);
  process.exitCode = 1;
}
