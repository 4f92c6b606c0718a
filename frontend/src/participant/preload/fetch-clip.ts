/** One clip over the network: stopped where no byte comes for a while, tried again, and its hash checked. */

export interface ClipSource {
  clip_sha256: string;
  clip_url: string;
}
export interface FetchOptions {
  attempts?: number;
  /** A transfer without a byte for so long is given up and tried again. */
  stall_ms?: number;
  pause?: (attempt: number) => Promise<void>;
  signal?: AbortSignal;
}

export type ClipFault = "offline" | "missing" | "corrupt";
export class ClipUnavailable extends Error {
  override name = "ClipUnavailable";
  constructor(
    readonly sha256: string,
    readonly fault: ClipFault,
  ) {
    super(`clip ${sha256.slice(0, 12)}: ${fault}`);
  }
}

const WAITS_MS = [400, 1_200, 3_000, 6_000];
const wait = (attempt: number): Promise<void> =>
  new Promise((resolve) => setTimeout(resolve, WAITS_MS[Math.min(attempt, WAITS_MS.length - 1)]));

/** The clip's bytes, whose SHA-256 is the declared one. Throws ClipUnavailable after the last attempt. */
export async function fetchClip(source: ClipSource, options: FetchOptions = {}): Promise<ArrayBuffer> {
  const { attempts = 4, stall_ms = 10_000, pause = wait, signal } = options;
  let fault: ClipFault = "offline";
  for (let attempt = 0; attempt < attempts; attempt += 1) {
    if (attempt > 0) await pause(attempt - 1);
    signal?.throwIfAborted();
    // A corrupt copy may sit in the browser's cache, which would hand it out for ever.
    const got = await attemptOnce(source.clip_url, stall_ms, fault === "corrupt" ? "reload" : "default", signal);
    if (typeof got === "string") fault = got;
    else if ((await sha256(got)) === source.clip_sha256) return got;
    else fault = "corrupt";
  }
  throw new ClipUnavailable(source.clip_sha256, fault);
}

async function attemptOnce(url: string, stall_ms: number, cache: RequestCache, signal?: AbortSignal): Promise<ArrayBuffer | ClipFault> {
  const stop = new AbortController();
  const abort = (): void => stop.abort();
  let timer = setTimeout(abort, stall_ms);
  const moving = (): void => {
    clearTimeout(timer);
    timer = setTimeout(abort, stall_ms);
  };
  signal?.addEventListener("abort", abort);
  try {
    const response = await fetch(url, { cache, signal: stop.signal });
    if (response.status === 404 || response.status === 410) return "missing";
    if (!response.ok || !response.body) return "offline";
    return await readAll(response.body, moving);
  } catch {
    return "offline";
  } finally {
    clearTimeout(timer);
    signal?.removeEventListener("abort", abort);
  }
}

async function readAll(body: ReadableStream<Uint8Array>, moving: () => void): Promise<ArrayBuffer> {
  const parts: Uint8Array<ArrayBuffer>[] = [];
  const reader = body.getReader();
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    parts.push(part.value as Uint8Array<ArrayBuffer>);
    moving();
  }
  return new Blob(parts).arrayBuffer();
}

export async function sha256(bytes: ArrayBuffer): Promise<string> {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
