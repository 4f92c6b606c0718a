/** The page's side of the worker: asks, and turns its messages into promises. */
import { backoff } from "../outbox/backoff";
import { ClipBroken, type ClipPlayer, type Part, type PlayOptions, type Prepared, type ShownClip } from "./player";
import type { FromWorker, ToWorker } from "./protocol";

const DECODE_LIMIT_MS = 20_000;
const START_LIMIT_MS = 20_000;
const MAX_STARTS = 6;

interface Waiting {
  resolve: (message: FromWorker) => void;
  reject: (error: Error) => void;
  limit?: ReturnType<typeof setTimeout>;
}

/** A page laid out anew while a clip's first frames are drawn takes their place on the way to the screen. */
function layoutShown(): Promise<void> {
  return new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(() => resolve())));
}

/** A worker whose script has run: it is fetched anew where it was lost on the way. Rejects where it never comes. */
export async function startedWorker(): Promise<Worker> {
  for (let failures = 1; failures <= MAX_STARTS; failures++) {
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    const has_started = await new Promise<boolean>((resolve) => {
      worker.onmessage = () => resolve(true);
      worker.onerror = () => resolve(false);
      setTimeout(resolve, START_LIMIT_MS, false);
    });
    if (has_started) return worker;
    worker.terminate();
    await new Promise((resolve) => setTimeout(resolve, backoff(failures)));
  }
  throw new ClipBroken("the worker could not be started");
}

export class WorkerPlayer implements ClipPlayer {
  readonly method = "webcodecs";
  readonly element = document.createElement("canvas");
  private readonly prepared = new Map<string, Promise<Prepared>>();
  private readonly waiting = new Map<string, Set<Waiting>>();

  constructor(
    private readonly worker: Worker,
    background: string,
    sync_patch: boolean,
  ) {
    this.worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.arrived(data);
    this.worker.onerror = (event) => this.broken(event.message || "the worker stopped");
    const canvas = this.element.transferControlToOffscreen();
    this.tell({ type: "canvas", canvas, background, sync_patch }, [canvas]);
  }

  prepare(sha256: string, bytes: ArrayBuffer, fps: number | null): Promise<Prepared> {
    const known = this.prepared.get(sha256);
    if (known) return known;
    const asked = this.ask(`prepared ${sha256}`, DECODE_LIMIT_MS);
    // The page keeps its own copy for a second view, so the bytes are copied and not handed over.
    this.tell({ type: "prepare", sha256, bytes, fps });
    const result = asked.then((message) => message as FromWorker & { type: "prepared" });
    this.keep(sha256, result);
    return result;
  }

  compose(name: string, parts: readonly Part[], width: number, height: number): Promise<Prepared> {
    const asked = this.ask(`prepared ${name}`, DECODE_LIMIT_MS);
    this.tell({ type: "compose", sha256: name, parts: [...parts], width, height });
    const result = asked.then((message) => message as FromWorker & { type: "prepared" });
    this.keep(name, result);
    return result;
  }

  blank(sha256: string): void {
    void this.prepared.get(sha256)?.then(
      ({ width, height }) => this.tell({ type: "blank", width, height }),
      () => {},
    );
  }

  async play(sha256: string, { ready, ...options }: PlayOptions): Promise<ShownClip> {
    const { frames, fps } = (await this.prepared.get(sha256)) ?? { frames: 0, fps: 30 };
    // A hidden page gets no refreshes: it then ends when it is looked at again, and the gap says so.
    const asked = this.ask(`played ${sha256}`, Infinity);
    this.tell({ type: "warm" });
    await Promise.all([layoutShown(), ready]);
    this.tell({ type: "play", sha256, ...options });
    const message = (await asked) as FromWorker & { type: "played" };
    const { drawn, ended_at_ms, clock_gap_ms, clock_late_ms, refresh_ms } = message;
    return { method: "webcodecs", drawn, ended_at_ms, clock_gap_ms, clock_late_ms, refresh_ms, stalls: 0, frames, fps };
  }

  release(sha256: string): void {
    this.prepared.delete(sha256);
    this.tell({ type: "release", sha256 });
  }

  private keep(name: string, result: Promise<Prepared>): void {
    this.prepared.set(name, result);
    result.catch(() => this.prepared.get(name) === result && this.prepared.delete(name));
  }

  private ask(name: string, limit_ms: number): Promise<FromWorker> {
    return new Promise((resolve, reject) => {
      const asked: Waiting = { resolve, reject };
      // A clip released and prepared anew is asked for twice by one name: each has a limit of its own.
      this.waiting.set(name, (this.waiting.get(name) ?? new Set()).add(asked));
      if (limit_ms === Infinity) return;
      asked.limit = setTimeout(() => {
        this.waiting.get(name)?.delete(asked);
        reject(new ClipBroken(`no answer in ${limit_ms} ms`));
      }, limit_ms);
    });
  }

  private settle(name: string, outcome: FromWorker | Error): void {
    const all = this.waiting.get(name) ?? [];
    this.waiting.delete(name);
    for (const asked of all) {
      clearTimeout(asked.limit);
      if (outcome instanceof Error) asked.reject(outcome);
      else asked.resolve(outcome);
    }
  }

  private arrived(message: FromWorker): void {
    if (message.type !== "failed") return this.settle(`${message.type} ${message.sha256}`, message);
    for (const step of ["prepared", "played"]) this.settle(`${step} ${message.sha256}`, new ClipBroken(message.reason));
  }

  private broken(reason: string): void {
    for (const name of [...this.waiting.keys()]) this.settle(name, new ClipBroken(reason));
  }

  private tell(message: ToWorker, transfer: Transferable[] = []): void {
    this.worker.postMessage(message, transfer);
  }
}
