import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { FromWorker, ToWorker } from "../../src/participant/playback/protocol";
import { choosePlayer, WorkerPlayer } from "../../src/participant/playback/worker-player";

const CLIP = "a".repeat(64);
const LIMIT_MS = 20_000;

/** The worker's side of a player, by hand: a test says when it answers. */
class SilentWorker {
  onmessage: ((event: { data: FromWorker }) => void) | null = null;
  onerror: ((event: ErrorEvent) => void) | null = null;
  readonly requests: number[] = [];
  postMessage(message: ToWorker): void {
    if ("request" in message) this.requests.push(message.request);
  }
  /** Answer the newest request, or one before it. */
  answer(of: (request: number) => FromWorker, back = 0): void {
    this.onmessage?.({ data: of(this.requests.at(-1 - back) ?? 0) });
  }
}

const prepared = (request: number): FromWorker => ({ type: "prepared", request, width: 640, height: 480, frames: 45, fps: 30 });
const failed = (request: number): FromWorker => ({ type: "failed", request, reason: "not a video" });

function playerOf(worker: SilentWorker): WorkerPlayer {
  return new WorkerPlayer(worker as unknown as Worker, "#777777", false);
}

/** The clip is prepared, three seconds after it was asked for. */
async function isPreparedLate(player: WorkerPlayer, worker: SilentWorker): Promise<void> {
  const asked = player.prepare(CLIP, new ArrayBuffer(8), 30);
  vi.advanceTimersByTime(3000);
  worker.answer(prepared);
  await expect(asked).resolves.toMatchObject({ frames: 45 });
}

describe("what the page waits for from its worker", () => {
  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("document", { createElement: () => ({ transferControlToOffscreen: () => ({}) }) });
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  it("gives a clip that is prepared again the whole limit, whatever became of the first time", async () => {
    const worker = new SilentWorker();
    const player = playerOf(worker);
    const first = player.prepare(CLIP, new ArrayBuffer(8), 30);
    worker.answer(prepared);
    await first;
    player.release(CLIP);
    vi.advanceTimersByTime(LIMIT_MS - 1000);
    await isPreparedLate(player, worker);
  });

  it("does the same where the clip was given up before it was prepared", async () => {
    const worker = new SilentWorker();
    const player = playerOf(worker);
    void player.prepare(CLIP, new ArrayBuffer(8), 30).catch(() => {});
    vi.advanceTimersByTime(LIMIT_MS - 1000);
    player.release(CLIP);
    await isPreparedLate(player, worker);
  });

  it("takes no late answer to a clip given up for one to the clip prepared again", async () => {
    const worker = new SilentWorker();
    const player = playerOf(worker);
    const given_up = expect(player.prepare(CLIP, new ArrayBuffer(8), 30)).rejects.toThrow("not a video");
    player.release(CLIP);
    const again = player.prepare(CLIP, new ArrayBuffer(8), 30);
    worker.answer(failed, 1);
    await given_up;
    worker.answer(prepared);
    await expect(again).resolves.toMatchObject({ frames: 45 });
  });

  it("hears of a worker that breaks before a clip is asked to be shown", async () => {
    vi.stubGlobal("requestAnimationFrame", () => 0);
    const worker = new SilentWorker();
    const player = playerOf(worker);
    const asked = player.prepare(CLIP, new ArrayBuffer(8), 30);
    worker.answer(prepared);
    await asked;
    const shown = expect(player.play(CLIP, { refresh_ms: 16, fixation_ms: 0 })).rejects.toThrow("out of memory");
    await Promise.resolve();
    worker.onerror?.({ message: "out of memory" } as ErrorEvent);
    await shown;
  });

  it("puts the times of a worker whose clock has another origin on the page's clock", async () => {
    vi.stubGlobal("requestAnimationFrame", (then: () => void) => setTimeout(then, 16));
    const ahead_ms = 3_600_000;
    const worker = new SilentWorker();
    const own_ms = (): number => performance.timeOrigin + performance.now() + ahead_ms;
    const post = worker.postMessage.bind(worker);
    worker.postMessage = (message) => {
      post(message);
      if (message.type === "time") worker.answer((request) => ({ type: "time", request, at_ms: own_ms() }));
    };
    const player = playerOf(worker);
    await player.measureClock();
    const asked = player.prepare(CLIP, new ArrayBuffer(8), 30);
    worker.answer(prepared);
    await asked;
    const shown = player.play(CLIP, { refresh_ms: 16, fixation_ms: 0 });
    await vi.advanceTimersByTimeAsync(100);
    const drawn_ms = performance.timeOrigin + performance.now();
    const figures = { frames: 1, fps: 30, clock_gap_ms: 0, clock_late_ms: 0, refresh_ms: 16 };
    worker.answer((request) => ({ type: "played", request, drawn: [[0, own_ms()]], ended_at_ms: own_ms() + 33, ...figures }));
    const { drawn, ended_at_ms } = await shown;
    expect(drawn[0]?.[1]).toBeCloseTo(drawn_ms, 0);
    expect(ended_at_ms - drawn_ms).toBeCloseTo(33, 0);
  });

  it("ends a worker that has started and then never answers, and shows clips by the video element", async () => {
    let ended = 0;
    vi.stubGlobal(
      "Worker",
      class extends SilentWorker {
        constructor() {
          super();
          setTimeout(() => this.onmessage?.({ data: { type: "started" } as unknown as FromWorker }), 1);
        }
        terminate(): void {
          ended += 1;
        }
      },
    );
    const transferControlToOffscreen = (): object => ({});
    vi.stubGlobal("HTMLCanvasElement", { prototype: { transferControlToOffscreen } });
    vi.stubGlobal("VideoDecoder", {});
    vi.stubGlobal("OffscreenCanvas", {});
    vi.stubGlobal("document", { createElement: () => ({ transferControlToOffscreen, style: {}, append: () => {} }) });
    vi.spyOn(console, "warn").mockImplementation(() => {});
    const chosen = choosePlayer({ background: "#777777", sync_patch: false });
    await vi.advanceTimersByTimeAsync(LIMIT_MS);
    expect((await chosen).method).toBe("video");
    expect(ended).toBe(1);
  });

  it("says that a worker which never answers did not", async () => {
    const worker = new SilentWorker();
    const waiting = expect(playerOf(worker).prepare(CLIP, new ArrayBuffer(8), 30)).rejects.toThrow(`no answer in ${LIMIT_MS} ms`);
    vi.advanceTimersByTime(LIMIT_MS + 1);
    await waiting;
  });
});
