/**
 * Keeps the participant's page itself (its HTML and files, nothing else), so that a reload without a connection finds it.
 *
 * The network is asked first for the page, the copy for its files, whose names carry their hash. Clips and everything
 * under /api pass by: clips are kept by the browser's own cache, and an answer of the server is never made up.
 */

interface Extendable extends Event {
  waitUntil(work: Promise<unknown>): void;
}
interface Fetching extends Extendable {
  request: Request;
  respondWith(answer: Promise<Response>): void;
}
interface Scope {
  skipWaiting(): Promise<void>;
  addEventListener(type: "install" | "activate", listener: (event: Extendable) => void): void;
  addEventListener(type: "fetch", listener: (event: Fetching) => void): void;
}
// Decision 0221: A service worker keeps the page, and only the page.
const scope = self as unknown as Scope;

/** The built files next to this one; the build lists them here. */
declare const __FILES__: string[];
const FILES = __FILES__;
/** Any link gives the same page, which reads its link from the address. */
const PAGE = "/run/offline";
const NAME = `palpebra page ${FILES.join(" ")}`;
const WAIT_MS = 8_000;
const CACHE_WAIT_MS = 2_000;

async function keep(): Promise<void> {
  const page = await fetch(PAGE, { cache: "no-store" });
  const html = await page.clone().text();
  const named = [...html.matchAll(/"(\/assets\/participant\/[^"]+)"/g)].map((match) => match[1] ?? "");
  const hashed = named.filter((name) => !name.includes("?"));
  if (!page.ok || hashed.length === 0 || !hashed.every((name) => FILES.includes(name))) {
    throw new Error("the page and this worker are of different builds");
  }
  const cache = await caches.open(NAME);
  await cache.addAll([...new Set([...FILES, ...named])]);
  await cache.put(PAGE, page);
  await scope.skipWaiting();
}

async function forgetOlder(): Promise<void> {
  const names = await caches.keys();
  await Promise.all(names.filter((name) => name.startsWith("palpebra page") && name !== NAME).map((name) => caches.delete(name)));
}

/** The copy, where there is one that can be read in time: a denied or hanging cache must not keep the page away. */
function copyOf(what: RequestInfo): Promise<Response | undefined> {
  const late = new Promise<undefined>((resolve) => setTimeout(resolve, CACHE_WAIT_MS));
  return Promise.race([(async () => caches.match(what, { ignoreVary: true }))().catch(() => undefined), late]);
}

async function page(request: Request): Promise<Response> {
  const kept = await copyOf(PAGE);
  if (!kept) return fetch(request);
  const late = new Promise<null>((resolve) => setTimeout(() => resolve(null), WAIT_MS));
  const answer = await Promise.race([fetch(request).catch(() => null), late]);
  // 502 to 504: a proxy whose server is away.
  return answer && (answer.status < 502 || answer.status > 504) ? answer : kept;
}

async function file(request: Request): Promise<Response> {
  return (await copyOf(request)) ?? fetch(request);
}

scope.addEventListener("install", (event) => event.waitUntil(keep()));
scope.addEventListener("activate", (event) => event.waitUntil(forgetOlder()));
scope.addEventListener("fetch", (event) => {
  const { request } = event;
  const { pathname, origin } = new URL(request.url);
  if (request.method !== "GET" || origin !== location.origin) return;
  if (request.mode === "navigate" && pathname.startsWith("/run/")) event.respondWith(page(request));
  else if (pathname.startsWith("/assets/participant/")) event.respondWith(file(request));
});

export {};
