/**
 * Decodes clips ahead and draws them at screen refreshes, away from the page's own work.
 * Every drawn frame's index and time is logged and returned.
 */
import { type Composed, composition, drawFrame, framesOf, type SingleClip, streamsOf } from "./compose";
import { decodeClip } from "./decode";
import { type Part, absoluteNow, type FromWorker, type Started, type ToWorker, EvennessMeter, type Job, RefreshClock } from "./protocol";
import { FrameSchedule, trueRefresh } from "./record";
import type { drawSyncPatch } from "./sync-patch";

interface Scope {
  postMessage(message: FromWorker | Started): void;
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  requestAnimationFrame(callback: (now: number) => void): number;
}
const scope = self as unknown as Scope;

/** Refreshes before a clip's first frame: a browser that has just begun to draw may put two pictures into one. */
const WARM_REFRESHES = 4;
/** Refreshes after those in which nothing is painted: a picture more on its way would be one that is lost when the way gets shorter. */
const REST_REFRESHES = 2;
/** Firefox takes a picture shortly after the refresh, where one drawn at once may have taken the place of the one before. */
const DRAWS_AFTER = navigator.userAgent.includes("Firefox") ? 1 / 3 : 0;
/** The same in ms: it is a share of the time between refreshes. */
let draw_after_ms = 0;
const putOff = (run: () => void): unknown => (draw_after_ms ? setTimeout(run, draw_after_ms) : run());
const clock = new RefreshClock((callback) => scope.requestAnimationFrame(callback), absoluteNow, performance.timeOrigin, putOff);

const clips = new Map<string, SingleClip | Composed>();
/** The newest request to prepare each clip that was not released since. */
const newest = new Map<string, number>();
let context: OffscreenCanvasRenderingContext2D | null = null;
let background = "#808080";
let mark: typeof drawSyncPatch | null = null;

async function prepare(request: number, sha256: string, bytes: ArrayBuffer, declared_fps: number | null): Promise<void> {
  newest.set(sha256, request);
  try {
    const clip = clips.get(sha256) ?? (await decodeClip(bytes, declared_fps));
    const { fps, width, height } = clip;
    const frames = framesOf(clip);
    // Released, or asked for again, while it was decoded: pictures that nobody would release must not stay.
    if (newest.get(sha256) === request) clips.set(sha256, clip);
    else close(clip);
    scope.postMessage({ type: "prepared", request, frames, width, height, fps });
  } catch (error) {
    failed(request, error);
  }
}

function failed(request: number, reason: unknown): void {
  scope.postMessage({ type: "failed", request, reason: String(reason) });
}

/** Put decoded clips on one canvas, under a new name. */
function compose(request: number, name: string, parts: readonly Part[], width: number, height: number): void {
  try {
    const composed = composition(parts, (sha256) => clips.get(sha256), width, height);
    clips.set(name, composed);
    scope.postMessage({ type: "prepared", request, frames: framesOf(composed), width, height, fps: composed.fps });
  } catch (error) {
    failed(request, error);
  }
}

function release(sha256: string): void {
  const clip = clips.get(sha256);
  if (clip) close(clip);
  clips.delete(sha256);
  newest.delete(sha256);
}

function close(clip: SingleClip | Composed): void {
  // A composed clip owns no pictures: its parts are released under their own hashes.
  if ("bitmaps" in clip) clip.bitmaps.forEach((bitmap) => bitmap.close());
  else if ("close" in clip) clip.close();
}

function blank(): void {
  if (!context) return;
  context.fillStyle = background;
  context.fillRect(0, 0, context.canvas.width, context.canvas.height);
  mark?.(context, null);
}

async function loadSyncPatch(): Promise<void> {
  mark = (await import("./sync-patch")).drawSyncPatch;
  blank();
}

function cross(): void {
  if (!context) return;
  const { width, height } = context.canvas;
  const arm = Math.round(height / 24);
  const line = Math.max(2, Math.round(arm / 8));
  context.fillStyle = "#000";
  context.fillRect(width / 2 - arm, height / 2 - line / 2, 2 * arm, line);
  context.fillRect(width / 2 - line / 2, height / 2 - arm, line, 2 * arm);
}

/** The surround at each refresh, so that the way to the screen is in step when the first frame comes. */
function warm(): void {
  clock.start(blank);
}

function play(request: number, sha256: string, refresh_ms: number, fixation_ms: number): void {
  const clip = clips.get(sha256);
  if (!clip || !context) return failed(request, "expected a prepared clip and a canvas");
  const start = (): void => begin(request, clip, refresh_ms, fixation_ms);
  const streams = streamsOf(clip);
  if (streams.length === 0) return start();
  Promise.all(streams.map((stream) => stream.rewind())).then(start, (error: unknown) => stopBroken(request, error));
}

/** The surround again, and the reason to the page. */
function stopBroken(request: number, reason: unknown): void {
  clock.stop();
  blank();
  failed(request, reason);
}

function begin(request: number, clip: SingleClip | Composed, refresh_ms: number, fixation_ms: number): void {
  // Time by the clock, and refreshes counted besides: on a fast screen four of them are over before the way is in step.
  const until = absoluteNow() + fixation_ms;
  draw_after_ms = Math.floor(DRAWS_AFTER * refresh_ms);
  const waited = new EvennessMeter();
  let rest = REST_REFRESHES;
  clock.start((refresh_at_ms, ran_at_ms) => {
    waited.add(refresh_at_ms, ran_at_ms);
    if (absoluteNow() < until || clock.refreshes <= WARM_REFRESHES) {
      blank();
      if (fixation_ms > 0) cross();
    } else {
      // Refreshes are counted: a screen faster than believed would show the clip too fast.
      const true_ms = trueRefresh(waited.read().refresh_ms, refresh_ms);
      if (rest === REST_REFRESHES) draw_after_ms = Math.floor(DRAWS_AFTER * true_ms);
      if (rest-- > 0) return;
      const show = showing(request, clip, true_ms);
      // In the same refresh: the first frame is drawn now, not one refresh later.
      clock.start(show);
      show(refresh_at_ms, ran_at_ms);
    }
  });
}

function showing(request: number, clip: SingleClip | Composed, refresh_ms: number): Job {
  const streams = streamsOf(clip);
  const schedule = new FrameSchedule(framesOf(clip), 1000 / clip.fps, refresh_ms);
  const evenness = new EvennessMeter();
  const drawn: [number, number][] = [];
  return (refresh_at_ms, ran_at_ms) => {
    evenness.add(refresh_at_ms, ran_at_ms);
    const broken = streams.find(({ problem }) => problem);
    if (broken) return stopBroken(request, broken.problem);
    if (schedule.isOver(refresh_at_ms)) {
      clock.stop();
      blank();
      const figures = { frames: framesOf(clip), fps: clip.fps, ended_at_ms: absoluteNow(), ...evenness.read() };
      scope.postMessage({ type: "played", request, drawn, ...figures });
      // Ready for another view before it is asked for.
      for (const stream of streams) stream.rewind().catch(() => {});
      return;
    }
    const index = schedule.next(refresh_at_ms);
    if (index === null || !context) return;
    // Not decoded in time: the picture stays, and the log says that this frame is missing.
    if (!drawFrame(context, clip, index)) return;
    mark?.(context, index);
    drawn.push([index, absoluteNow() - draw_after_ms]);
  };
}

function resize(width: number, height: number): void {
  if (!context) return;
  const canvas = context.canvas;
  // Setting a canvas's size clears it, so it is left alone where it fits already.
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  blank();
}

scope.onmessage = ({ data }) => {
  if (data.type === "canvas") {
    background = data.background;
    // Opaque: the compositor need not blend the page behind it, which would be one more step on the way.
    context = data.canvas.getContext("2d", { alpha: false });
    blank();
    if (data.sync_patch) void loadSyncPatch();
  } else if (data.type === "time") scope.postMessage({ type: "time", request: data.request, at_ms: absoluteNow() });
  else if (data.type === "prepare") void prepare(data.request, data.sha256, data.bytes, data.fps);
  else if (data.type === "release") release(data.sha256);
  else if (data.type === "blank") resize(data.width, data.height);
  else if (data.type === "compose") compose(data.request, data.sha256, data.parts, data.width, data.height);
  else if (data.type === "warm") warm();
  else play(data.request, data.sha256, data.refresh_ms, data.fixation_ms);
};
scope.postMessage({ type: "started" });
