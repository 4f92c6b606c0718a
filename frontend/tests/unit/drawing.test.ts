import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { FromWorker, ToWorker } from "../../src/participant/playback/protocol";

const FRAMES = 5;
const REFRESH_MS = 1000 / 60;
const SHA256 = "a".repeat(64);
const closed = vi.fn();
vi.mock("../../src/participant/playback/decode", () => ({
  decodeClip: () =>
    Promise.resolve({ bitmaps: Array.from({ length: FRAMES }, (_, index) => ({ index, close: closed })), fps: 60, width: 8, height: 4 }),
}));

/** What the worker is to a browser: refreshes come when the test says so, and each painting is noted. */
class FakeScope {
  onmessage: ((event: { data: ToWorker }) => void) | null = null;
  readonly messages: FromWorker[] = [];
  readonly painted: string[] = [];
  private waiting: ((now: number) => void)[] = [];

  postMessage = (message: FromWorker): void => void this.messages.push(message);
  requestAnimationFrame = (callback: (now: number) => void): number => this.waiting.push(callback);
  receive = (data: ToWorker): void => this.onmessage?.({ data });

  canvas(): OffscreenCanvas {
    const canvas = { width: 8, height: 4 };
    const context = {
      canvas,
      fillRect: () => this.painted.push("surround"),
      drawImage: ({ index }: { index: number }) => this.painted.push(`frame ${index}`),
    };
    return { ...canvas, getContext: () => context } as unknown as OffscreenCanvas;
  }

  /** What was painted at the refresh, and what by `later_ms` after it. */
  refresh(later_ms: number, period_ms = REFRESH_MS): { at_once: string[]; later: string[] } {
    this.painted.length = 0;
    for (const callback of this.waiting.splice(0)) callback(performance.now());
    const at_once = [...this.painted];
    this.painted.length = 0;
    vi.advanceTimersByTime(later_ms);
    const later = [...this.painted];
    vi.advanceTimersByTime(period_ms - later_ms);
    return { at_once, later };
  }
}

async function workerIn(browser: string): Promise<FakeScope> {
  const scope = new FakeScope();
  vi.stubGlobal("self", scope);
  vi.stubGlobal("navigator", { userAgent: `Mozilla/5.0 ${browser}` });
  vi.resetModules();
  await import("../../src/participant/playback/worker");
  scope.receive({ type: "canvas", canvas: scope.canvas(), background: "#808080", sync_patch: false });
  scope.receive({ type: "prepare", request: 1, sha256: SHA256, bytes: new ArrayBuffer(1), fps: 60 });
  await vi.waitFor(() => expect(scope.messages.at(-1)?.type).toBe("prepared"));
  scope.receive({ type: "warm" });
  scope.receive({ type: "play", request: 2, sha256: SHA256, refresh_ms: REFRESH_MS, fixation_ms: 0 });
  return scope;
}

describe("the way to the screen", () => {
  beforeEach(() => void vi.useFakeTimers({ toFake: ["setTimeout", "performance"] }));
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  it("is warmed, and then left alone for two refreshes so that no picture waits on it when the clip begins", async () => {
    const scope = await workerIn("Chrome/156");
    const refreshes = Array.from({ length: 9 }, () => scope.refresh(8).at_once[0] ?? "nothing");
    expect(refreshes).toEqual([...Array<string>(4).fill("surround"), "nothing", "nothing", "frame 0", "frame 1", "frame 2"]);
  });

  it("shows a clip at its own rate on a screen that is faster than was believed", async () => {
    const scope = await workerIn("Chrome/156");
    const refreshes = Array.from({ length: 11 }, () => scope.refresh(4, 10).at_once[0] ?? "nothing");
    expect(refreshes.slice(6)).toEqual(["frame 0", "nothing", "frame 1", "frame 2", "nothing"]);
  });

  it("puts Firefox's pictures off by a third of that screen's refresh too", async () => {
    const scope = await workerIn("Firefox/153.0");
    const refreshes = Array.from({ length: 11 }, () => scope.refresh(4, 10).later[0] ?? "nothing");
    expect(refreshes.slice(6)).toEqual(["frame 0", "nothing", "frame 1", "frame 2", "nothing"]);
  });

  it("gets Firefox's pictures a third of a refresh later, when the one before has been taken", async () => {
    const scope = await workerIn("Firefox/153.0");
    const refreshes = Array.from({ length: 9 }, () => scope.refresh(5));
    expect(refreshes.at(-1)).toEqual({ at_once: [], later: ["frame 2"] });
  });

  it("loses no refresh in Firefox where a timer comes later than the next one", async () => {
    const scope = await workerIn("Firefox/153.0");
    for (let count = 0; count < 7; count += 1) scope.refresh(8);
    const timer = setTimeout;
    const late = (run: () => void, wait_ms: number): unknown => timer(run, wait_ms + 14);
    vi.stubGlobal("setTimeout", late);
    scope.refresh(8);
    vi.stubGlobal("setTimeout", timer);
    for (let count = 0; count < FRAMES; count += 1) scope.refresh(8);
    const played = scope.messages.at(-1) as FromWorker & { type: "played" };
    expect(played.drawn.map(([index]) => index)).toEqual([0, 1, 2, 3, 4]);
    expect(played.clock_late_ms).toBeCloseTo(19, 0);
  });

  it.each([
    ["Chrome/156", 0],
    ["Firefox/153.0", 5],
  ])("is recorded with the refresh's time in %s, and the clock as even and that late", async (browser, late_ms) => {
    const scope = await workerIn(browser);
    const began = performance.timeOrigin + performance.now();
    for (let count = 0; count < 6 + FRAMES + 1; count += 1) scope.refresh(8);
    const played = scope.messages.at(-1) as FromWorker & { type: "played" };
    expect(played.drawn.map(([index]) => index)).toEqual([0, 1, 2, 3, 4]);
    played.drawn.forEach(([index, at_ms]) => expect(at_ms - began).toBeCloseTo((6 + index) * REFRESH_MS, 3));
    expect([played.clock_late_ms, played.clock_gap_ms]).toEqual([expect.closeTo(late_ms, 3), expect.closeTo(REFRESH_MS, 3)]);
  });
});

describe("a clip that is given up", () => {
  beforeEach(() => void vi.useFakeTimers({ toFake: ["setTimeout", "performance"] }));
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });
  const prepare = (request: number): ToWorker => ({ type: "prepare", request, sha256: SHA256, bytes: new ArrayBuffer(1), fps: 60 });

  it("keeps no picture where it was given up before it was decoded, and is there where it is asked for again", async () => {
    const scope = await workerIn("Chrome");
    closed.mockClear();
    scope.receive({ type: "release", sha256: SHA256 });
    expect(closed).toHaveBeenCalledTimes(FRAMES);
    scope.receive(prepare(3));
    scope.receive({ type: "release", sha256: SHA256 });
    scope.receive(prepare(4));
    await vi.waitFor(() => expect(scope.messages.at(-1)).toMatchObject({ type: "prepared", request: 4 }));
    expect(closed).toHaveBeenCalledTimes(2 * FRAMES);
    scope.receive({ type: "release", sha256: SHA256 });
    expect(closed).toHaveBeenCalledTimes(3 * FRAMES);
  });
});
