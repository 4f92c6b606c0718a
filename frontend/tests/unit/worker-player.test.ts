import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { FromWorker } from "../../src/participant/playback/protocol";
import { WorkerPlayer } from "../../src/participant/playback/worker-player";

const CLIP = "a".repeat(64);
const LIMIT_MS = 20_000;

/** The worker's side of a player, by hand: a test says when it answers. */
class SilentWorker {
  onmessage: ((event: { data: FromWorker }) => void) | null = null;
  onerror: ((event: ErrorEvent) => void) | null = null;
  postMessage(): void {}
  answer(data: FromWorker): void {
    this.onmessage?.({ data });
  }
}

const prepared = (sha256: string): FromWorker => ({ type: "prepared", sha256, width: 640, height: 480, frames: 45, fps: 30 });

function playerOf(worker: SilentWorker): WorkerPlayer {
  return new WorkerPlayer(worker as unknown as Worker, "#777777", false);
}

/** The clip is prepared, three seconds after it was asked for. */
async function isPreparedLate(player: WorkerPlayer, worker: SilentWorker): Promise<void> {
  const asked = player.prepare(CLIP, new ArrayBuffer(8), 30);
  vi.advanceTimersByTime(3000);
  worker.answer(prepared(CLIP));
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

  it("gives a clip that is prepared anew the whole limit, whatever became of the first time", async () => {
    const worker = new SilentWorker();
    const player = playerOf(worker);
    const first = player.prepare(CLIP, new ArrayBuffer(8), 30);
    worker.answer(prepared(CLIP));
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

  it("says that a worker which never answers did not", async () => {
    const worker = new SilentWorker();
    const waiting = expect(playerOf(worker).prepare(CLIP, new ArrayBuffer(8), 30)).rejects.toThrow(`no answer in ${LIMIT_MS} ms`);
    vi.advanceTimersByTime(LIMIT_MS + 1);
    await waiting;
  });
});
