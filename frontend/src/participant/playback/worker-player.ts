/** The player: chosen by what the browser can do, and shown by a worker where it can. */
import { backoff } from "../outbox/outbox";
import {
  absoluteNow,
  ClipBroken,
  type ClipPlayer,
  type Part,
  type PlayOptions,
  type Prepared,
  type ShownClip,
  type FromWorker,
  type Request,
  type ToWorker,
} from "./protocol";
import type { RunState } from "../../api/schema";
import { loadModule } from "../../ui/load-module";

// The page's side of the worker: asks, and turns its messages into promises.

// A decoder that hangs says nothing: after this the trial goes on without its clip.
const DECODE_LIMIT_MS = 20_000;
const START_LIMIT_MS = 10_000;
const MAX_STARTS = 4;
/** How often the worker's clock is read; the quickest answer counts. */
const CLOCK_READINGS = 5;

interface Waiting {
  resolve: (message: FromWorker) => void;
  reject: (error: Error) => void;
  limit: ReturnType<typeof setTimeout> | undefined;
}

/** A change of the page's layout delays the clip's first frames on their way to the screen. */
function layoutShown(): Promise<void> {
  // The first callback comes before the new layout is painted, the second after it.
  return new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(() => resolve())));
}

/** A worker whose script has run: the script is fetched again if it was lost on the way. Rejects if it never comes. */
async function startedWorker(): Promise<Worker> {
  for (let failures = 1; failures <= MAX_STARTS; failures++) {
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    const outcome = await new Promise<"started" | "lost" | "silent">((resolve) => {
      worker.onmessage = () => resolve("started");
      worker.onerror = () => resolve("lost");
      setTimeout(resolve, START_LIMIT_MS, "silent");
    });
    // The first message says that the script ran; `onerror` alone does not separate a slow network from a blocked one.
    if (outcome === "started") return worker;
    worker.terminate();
    // A worker that is blocked says nothing: another one would not either.
    if (outcome === "silent") break;
    await new Promise((resolve) => setTimeout(resolve, backoff(failures)));
  }
  throw new ClipBroken("the worker could not be started");
}

export class WorkerPlayer implements ClipPlayer {
  readonly method = "webcodecs";
  readonly element = document.createElement("canvas");
  private readonly prepared = new Map<string, Promise<Prepared>>();
  /** By request: a clip that is released and prepared again has two requests, and an old answer may be on its way. */
  private readonly waiting = new Map<number, Waiting>();
  private requests = 0;
  private clock_ahead_ms = 0;

  constructor(
    private readonly worker: Worker,
    background: string,
    sync_patch: boolean,
  ) {
    this.worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.arrived(data);
    this.worker.onerror = (event) => this.broken(event.message || "the worker stopped");
    // From here on the page cannot draw on it: only the worker does, whatever the page's own thread is busy with.
    const canvas = this.element.transferControlToOffscreen();
    this.send({ type: "canvas", canvas, background, sync_patch }, [canvas]);
  }

  /**
   * Find out how far the worker's clock is ahead of the page's. Both run evenly, but the origin of each is what the computer's
   * clock said when it was made: they differ where that clock was set, or the computer slept, between the two.
   */
  async measureClock(): Promise<void> {
    let shortest_ms = Infinity;
    for (let reading = 0; reading < CLOCK_READINGS; reading++) {
      const asked_ms = absoluteNow();
      const { at_ms } = (await this.ask({ type: "time" }, START_LIMIT_MS)) as FromWorker & { type: "time" };
      const answered_ms = absoluteNow();
      if (answered_ms - asked_ms >= shortest_ms) continue;
      shortest_ms = answered_ms - asked_ms;
      // Between question and answer the clocks may be the same.
      const is_same = at_ms >= asked_ms && at_ms <= answered_ms;
      this.clock_ahead_ms = is_same ? 0 : at_ms - (asked_ms + answered_ms) / 2;
    }
  }

  prepare(sha256: string, bytes: ArrayBuffer, fps: number | null): Promise<Prepared> {
    const known = this.prepared.get(sha256);
    if (known) return known;
    // The page keeps its own copy for a second view, so the bytes are copied and not handed over.
    return this.keep(sha256, this.ask({ type: "prepare", sha256, bytes, fps }, DECODE_LIMIT_MS));
  }

  compose(name: string, parts: readonly Part[], width: number, height: number): Promise<Prepared> {
    return this.keep(name, this.ask({ type: "compose", sha256: name, parts: [...parts], width, height }, DECODE_LIMIT_MS));
  }

  blank(sha256: string): void {
    void this.prepared.get(sha256)?.then(
      ({ width, height }) => this.send({ type: "blank", width, height }),
      () => {},
    );
  }

  async play(sha256: string, { ready, ...options }: PlayOptions): Promise<ShownClip> {
    const { frames, fps } = (await this.prepared.get(sha256)) ?? { frames: 0, fps: 30 };
    // While the view is still being kept: its way to the disk and the screen's warming up take place at once.
    this.send({ type: "warm" });
    // A hidden page gets no refreshes: it then ends when it is looked at again, and the gap says so.
    const asked = this.ask({ type: "play", sha256, ...options }, null, Promise.all([layoutShown(), ready]));
    const message = (await asked) as FromWorker & { type: "played" };
    const { clock_gap_ms, clock_late_ms, refresh_ms } = message;
    // By the page's clock, as the presses of keys are.
    const drawn = message.drawn.map(([index, at_ms]): [number, number] => [index, at_ms - this.clock_ahead_ms]);
    const ended_at_ms = message.ended_at_ms - this.clock_ahead_ms;
    return { method: "webcodecs", drawn, ended_at_ms, clock_gap_ms, clock_late_ms, refresh_ms, stalls: 0, frames, fps };
  }

  release(sha256: string): void {
    this.prepared.delete(sha256);
    this.send({ type: "release", sha256 });
  }

  private keep(name: string, asked: Promise<FromWorker>): Promise<Prepared> {
    const result = asked.then((message) => message as FromWorker & { type: "prepared" });
    this.prepared.set(name, result);
    // What failed may be tried again; a newer attempt under the same name stays.
    result.catch(() => this.prepared.get(name) === result && this.prepared.delete(name));
    return result;
  }

  /** Ask once `after` is over; a worker that breaks before is heard too. */
  private ask(asked: Request, limit_ms: number | null, after?: Promise<unknown>): Promise<FromWorker> {
    const request = ++this.requests;
    const answer = new Promise<FromWorker>((resolve, reject) => {
      const tooLate = (): void => this.settle(request, new ClipBroken(`no answer in ${limit_ms} ms`));
      const limit = limit_ms === null ? undefined : setTimeout(tooLate, limit_ms);
      this.waiting.set(request, { resolve, reject, limit });
    });
    const ask = (): void => this.send({ ...asked, request });
    if (after)
      after.then(ask).catch((error: unknown) => this.settle(request, error instanceof Error ? error : new ClipBroken(String(error))));
    else ask();
    return answer;
  }

  private settle(request: number, outcome: FromWorker | Error): void {
    const asked = this.waiting.get(request);
    this.waiting.delete(request);
    clearTimeout(asked?.limit);
    if (outcome instanceof Error) asked?.reject(outcome);
    else asked?.resolve(outcome);
  }

  private arrived(message: FromWorker): void {
    this.settle(message.request, message.type === "failed" ? new ClipBroken(message.reason) : message);
  }

  private broken(reason: string): void {
    // Loop over a copy of the keys, since each request that is settled leaves the map.
    for (const request of [...this.waiting.keys()]) this.settle(request, new ClipBroken(reason));
  }

  private send(message: ToWorker, transfer: Transferable[] = []): void {
    this.worker.postMessage(message, transfer);
  }
}

// Frame by frame in the worker where that is possible, else the video element.

export function hasWebCodecs(): boolean {
  return "VideoDecoder" in globalThis && "OffscreenCanvas" in globalThis && "transferControlToOffscreen" in HTMLCanvasElement.prototype;
}

/** Most clips are H.264, High profile; a browser built without licensed codecs lacks it. */
const H264 = "avc1.640028";

/** True where the browser decodes H.264 the way its clips will be played. */
export async function playsH264(): Promise<boolean> {
  if (!hasWebCodecs()) return document.createElement("video").canPlayType(`video/mp4; codecs="${H264}"`) !== "";
  return VideoDecoder.isConfigSupported({ codec: H264, codedWidth: 960, codedHeight: 360 }).then(
    ({ supported }) => supported === true,
    () => false,
  );
}

/** True where any way to show clips exists. */
export function hasVideo(): boolean {
  return hasWebCodecs() || typeof document.createElement("video").play === "function";
}

type Display = Pick<RunState["display"], "background" | "sync_patch">;

/** The fallback is fetched only where it is needed: by a browser without a decoder, or one to which the worker never comes. */
export async function choosePlayer({ background, sync_patch }: Display): Promise<ClipPlayer> {
  const worker = hasWebCodecs() ? await startedWorker().catch(() => null) : null;
  try {
    if (worker) {
      const player = new WorkerPlayer(worker, background, sync_patch);
      await player.measureClock();
      return player;
    }
  } catch (error) {
    // A canvas that cannot be handed over, as where an extension guards canvases, or a worker that stopped.
    worker?.terminate();
    console.warn("clips are played by the video element", error);
  }
  const { VideoPlayer } = await loadModule(() => import("./video-player"));
  return new VideoPlayer();
}
