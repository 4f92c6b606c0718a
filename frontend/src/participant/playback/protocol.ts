/** What the page and the worker say to each other, the player that both serve, and the clock of refreshes. */
import type { Showing } from "./record";

// What shows clips: the worker where the browser has WebCodecs, else an ordinary video element.

export interface Prepared {
  frames: number;
  width: number;
  height: number;
  fps: number;
}
/** A prepared clip and its place on a canvas of several, in that canvas's pixels. */
export interface Part {
  sha256: string;
  x: number;
  y: number;
  width: number;
  height: number;
}
/** What the player itself knows of a showing; the page adds what happened around it. */
export type ShownClip = Omit<Showing, "key_at_ms" | "focus_lost" | "disturbances" | "visible_share">;
export interface PlayOptions {
  fixation_ms: number;
  refresh_ms: number;
  /** No frame is drawn before this. */
  ready?: Promise<void>;
}

/** The clip cannot be decoded or drawn here. */
export class ClipBroken extends Error {
  override name = "ClipBroken";
}

export interface ClipPlayer {
  readonly method: "webcodecs" | "video";
  /** The element that shows the clip; it is the same one for every trial. */
  readonly element: HTMLElement;
  /** Make a clip ready to start at once. Rejects with ClipBroken. */
  prepare(sha256: string, bytes: ArrayBuffer, fps: number | null): Promise<Prepared>;
  /**
   * Put prepared clips on one canvas under a new name: it is then played as a clip, one clock drawing frame k of
   * each in the same refresh. A shorter one holds its last frame. Rejects with ClipBroken.
   */
  compose(name: string, parts: readonly Part[], width: number, height: number): Promise<Prepared>;
  /** Give the element this clip's own pixel size and the surround's color. */
  blank(sha256: string): void;
  /** Show a prepared clip from the next screen refresh on; resolves after its last frame. */
  play(sha256: string, options: PlayOptions): Promise<ShownClip>;
  release(sha256: string): void;
}

// The worker's animation clock: calls one job at each screen refresh, and says how evenly it ran.

/** What a refresh is for. Times are absolute, in ms: the refresh's own, and when the callback ran. */
export type Job = (refresh_at_ms: number, ran_at_ms: number) => void;

export class RefreshClock {
  private job: Job | null = null;
  private going = false;
  private count = 0;

  constructor(
    private readonly request: (callback: (now: number) => void) => unknown,
    private readonly now_ms: () => number,
    private readonly origin_ms: number,
    /** Puts off what is done at a refresh; the next one is asked for at once, so that a late timer skips none. */
    private readonly putOff: (run: () => void) => unknown = (run) => run(),
  ) {}

  /** Refreshes since the clock was started, up to the one whose job runs. */
  get refreshes(): number {
    return this.count;
  }

  /** From the next refresh on; takes the place of the job before. */
  start(job: Job): void {
    this.job = job;
    // A refresh is asked for already: a second request would count each one twice.
    if (this.going) return;
    this.going = true;
    this.count = 0;
    this.request((now) => this.tick(now));
  }

  stop(): void {
    this.job = null;
  }

  private tick(now: number): void {
    if (!this.job) {
      this.going = false;
      return;
    }
    // Before the job, which may take longer than a refresh.
    this.request((next) => this.tick(next));
    this.putOff(() => this.run(now));
  }

  private run(now: number): void {
    this.count += 1;
    // The job may have been stopped between the refresh and its run.
    this.job?.(this.origin_ms + now, this.now_ms());
  }
}

/** How evenly the clock ran while a clip was shown, in ms; what it cannot see, nobody else in the page can. */
interface Evenness {
  /** Longest time between two callbacks. */
  clock_gap_ms: number;
  /** Longest time by which a callback ran after the refresh it was for. */
  clock_late_ms: number;
  /** Mean time between two refreshes that followed one another; null with fewer than two. */
  refresh_ms: number | null;
}

export class EvennessMeter {
  private before_ms: number | null = null;
  private gap_ms = 0;
  private late_ms = 0;
  private readonly refreshes_ms: number[] = [];

  add(refresh_at_ms: number, ran_at_ms: number): void {
    if (this.before_ms !== null) this.gap_ms = Math.max(this.gap_ms, ran_at_ms - this.before_ms);
    // Browsers may stamp a refresh later than its callback: negative values do not count.
    this.late_ms = Math.max(this.late_ms, ran_at_ms - refresh_at_ms);
    this.before_ms = ran_at_ms;
    this.refreshes_ms.push(refresh_at_ms);
  }

  read(): Evenness {
    return { clock_gap_ms: this.gap_ms, clock_late_ms: this.late_ms, refresh_ms: meanGap(this.refreshes_ms) };
  }
}

/** Mean time between refreshes without the missed ones. Stamps may be rounded to a millisecond, so the mean is more precise than the median. */
export function meanGap(stamps: readonly number[]): number | null {
  const gaps = stamps.slice(1).map((stamp, index) => stamp - (stamps[index] ?? stamp));
  const median = [...gaps].sort((a, b) => a - b)[Math.floor(gaps.length / 2)];
  // Zero as well: stamps that are rounded so coarsely say nothing of the rate.
  if (!median) return null;
  // A rounded gap is one longer or shorter: on a screen of 240 Hz that is a quarter.
  const regular = gaps.filter((gap) => Math.abs(gap - median) < Math.max(median / 4, 1.01));
  return regular.reduce((total, gap) => total + gap, 0) / regular.length;
}

// Messages between the page and the worker that decodes and draws. Times are absolute, by the worker's clock: timeOrigin + now, in ms.

/** What the worker answers, under the number that the page gave. */
export type Request =
  | { type: "time" }
  | { type: "prepare"; sha256: string; bytes: ArrayBuffer; fps: number | null }
  | { type: "play"; sha256: string; refresh_ms: number; fixation_ms: number }
  | { type: "compose"; sha256: string; parts: Part[]; width: number; height: number };

export type ToWorker =
  | (Request & { request: number })
  | { type: "canvas"; canvas: OffscreenCanvas; background: string; sync_patch: boolean }
  | { type: "warm" }
  | { type: "blank"; width: number; height: number }
  | { type: "release"; sha256: string };

/** The worker's first message. */
export interface Started {
  type: "started";
}

export type FromWorker =
  | { type: "time"; request: number; at_ms: number }
  | { type: "prepared"; request: number; frames: number; width: number; height: number; fps: number }
  | { type: "failed"; request: number; reason: string }
  | ({
      type: "played";
      request: number;
      drawn: [index: number, at_ms: number][];
      frames: number;
      fps: number;
      ended_at_ms: number;
    } & Evenness);

/**
 * Milliseconds by a clock that cannot be set. It begins at what the computer's clock said when the page or the worker was made,
 * so that the two may lie apart: see `measureClock` of the worker's player.
 */
export function absoluteNow(): number {
  return performance.timeOrigin + performance.now();
}
