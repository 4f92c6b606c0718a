/** Clips fetched ahead, checked by their hash, and kept until the visit is over. */

// One clip over the network: stopped where no byte comes for a while, tried again, and its hash checked.

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

// About threefold each time: a lost packet costs half a second, a server that restarts is met again within ten.
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
    // Separate from a bad connection, since the participant can only do something about the latter.
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

// The clips of a block, fetched four at a time and kept in memory until their block is over.

// Browsers open six connections to a host: two stay free for answers.
const AT_ONCE = 4;

export interface Progress {
  done: number;
  total: number;
  failed: ClipUnavailable[];
}
type Fetch = (source: ClipSource, options: { signal?: AbortSignal }) => Promise<ArrayBuffer>;

export class ClipCache {
  private readonly bytes = new Map<string, ArrayBuffer>();
  private readonly without = new Set<string>();
  private readonly loading = new Map<string, Promise<void>>();

  constructor(private readonly fetchOne: Fetch = fetchClip) {}

  get(sha256: string): ArrayBuffer | undefined {
    return this.bytes.get(sha256);
  }

  /** True where none of these must be waited for. */
  hasAll(sources: ClipSource[]): boolean {
    return sources.every(({ clip_sha256 }) => this.bytes.has(clip_sha256) || this.without.has(clip_sha256));
  }

  /** Go on without a clip that cannot be had. */
  giveUp(sha256: string): void {
    this.without.add(sha256);
  }

  /** Fetch what is missing; resolves with the clips that could not be had, after all others are here. */
  async load(sources: ClipSource[], report: (progress: Progress) => void = () => {}, signal?: AbortSignal): Promise<ClipUnavailable[]> {
    // Trials share clips: each is fetched and counted once.
    const distinct = [...new Map(sources.map((source) => [source.clip_sha256, source])).values()];
    const queue = [...distinct];
    const failed: ClipUnavailable[] = [];
    let done = 0;
    report({ done, total: distinct.length, failed });
    const worker = async (): Promise<void> => {
      for (let next = queue.shift(); next; next = queue.shift()) {
        await this.one(next, signal).then(
          () => (done += 1),
          (error: unknown) => {
            if (!(error instanceof ClipUnavailable)) throw error;
            failed.push(error);
          },
        );
        report({ done, total: distinct.length, failed });
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, worker));
    return failed;
  }

  /** Forget every clip but these. */
  keepOnly(sources: ClipSource[]): void {
    const kept = new Set(sources.map((source) => source.clip_sha256));
    for (const sha256 of this.bytes.keys()) if (!kept.has(sha256)) this.bytes.delete(sha256);
  }

  private one(source: ClipSource, signal?: AbortSignal): Promise<void> {
    if (this.bytes.has(source.clip_sha256)) return Promise.resolve();
    const running = this.loading.get(source.clip_sha256);
    // Loads overlap, as the next block is fetched while this one is shown: each clip still comes once.
    if (running) return running;
    const loading = this.fetchOne(source, signal ? { signal } : {})
      .then((bytes) => void this.bytes.set(source.clip_sha256, bytes))
      .finally(() => this.loading.delete(source.clip_sha256));
    this.loading.set(source.clip_sha256, loading);
    return loading;
  }
}
