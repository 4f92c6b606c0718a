/** How a clip was shown: which frame was due when, which were drawn, and the record that is sent. */
import type { PlaybackLog } from "../../api/schema";
import { count, duration, frameLog, offset, within } from "../measured";

// Which frame to draw at a screen refresh.
// Frame k is due k periods after frame 0 was drawn, and is drawn at the refresh nearest to that. After a hold-up
// it goes on at the frame that is due: those in between are missing, and the rest of the clip is in time.
// Where a frame's period is nearly a whole number of refreshes (60 fps on a screen of 59 Hz), each frame gets that
// number: the clip runs slower or faster by the difference, instead of losing a frame now and then. Refreshes are counted
// then, since the time between them may have been measured wrongly, or not yet.

/** Up to this share of the period, the clip follows the screen. */
// 60 fps on 59 Hz differ by 1.7 %, film's 24 on 23.976 by 0.1 %: speeds that nobody sees.
const LOCKED_WITHIN = 0.03;
const ROUNDING = 1e-6;

/** Refreshes that follow one another within less than this share of the time believed are those of a faster screen. */
// Between neighbors such as 60 and 75 Hz (0.8), and beyond the jitter of a mean over some refreshes.
const FASTER = 0.85;

/** The time between refreshes to go by: that which was seen, where the screen is faster than was believed. */
export function trueRefresh(seen_ms: number | null, believed_ms: number): number {
  return seen_ms !== null && seen_ms < FASTER * believed_ms ? seen_ms : believed_ms;
}

/** The time a frame is shown for on a screen with that time between refreshes. */
function shownPeriod(declared_period_ms: number, refresh_ms: number): number {
  const locked_ms = Math.max(1, Math.round(declared_period_ms / refresh_ms)) * refresh_ms;
  const is_locked = Math.abs(locked_ms - declared_period_ms) <= LOCKED_WITHIN * declared_period_ms;
  return is_locked ? locked_ms : declared_period_ms;
}

export class FrameSchedule {
  private before_ms: number | null = null;
  private elapsed_ms = 0;
  private last = -1;
  private readonly period_ms: number;
  private readonly is_locked: boolean;

  constructor(
    private readonly frames: number,
    declared_period_ms: number,
    private readonly refresh_ms: number,
  ) {
    this.period_ms = shownPeriod(declared_period_ms, refresh_ms);
    const refreshes = this.period_ms / refresh_ms;
    this.is_locked = Math.abs(refreshes - Math.round(refreshes)) < ROUNDING;
  }

  /** Index of the frame to draw at the refresh of time `now_ms`, or null where the picture stays. */
  next(now_ms: number): number | null {
    if (this.before_ms === null) {
      this.before_ms = now_ms;
      return (this.last = 0);
    }
    // The last frame stays while it is due; that the clip is over is for `isOver` to say.
    const due = Math.min(this.frames - 1, this.periods(now_ms));
    return due <= this.last ? null : (this.last = due);
  }

  /** True when the last frame has been shown for its period. */
  isOver(now_ms: number): boolean {
    return this.last >= this.frames - 1 && this.periods(now_ms) >= this.frames;
  }

  /** How many periods have passed since frame 0. */
  private periods(now_ms: number): number {
    const { refresh_ms } = this;
    const passed_ms = now_ms - (this.before_ms ?? now_ms);
    // Summed step by step, not taken from the start: a wrong refresh time would add up over a long clip.
    const step_ms = this.is_locked ? Math.round(passed_ms / refresh_ms) * refresh_ms : passed_ms;
    if (step_ms > 0) {
      this.before_ms = now_ms;
      this.elapsed_ms += step_ms;
    }
    // Half a refresh on: the refresh nearest to a frame's time draws it, not the first after it.
    return Math.floor((this.elapsed_ms + refresh_ms / 2) / this.period_ms);
  }
}

// From the frames that were drawn to the figures stored with the rating.

/** Every key of the server's log, with the list of drawn frames. */
export type PlaybackRecord = Required<PlaybackLog> & { drawn: NonNullable<PlaybackLog["drawn"]> };
type PlaybackMethod = PlaybackLog["method"];

/** One showing of a clip. Times are absolute, in ms. */
export interface Showing {
  method: PlaybackMethod;
  key_at_ms: number;
  ended_at_ms: number;
  drawn: [index: number, at_ms: number][];
  frames: number;
  fps: number;
  stalls: number;
  /** How unevenly the animation clock ran; null where it could not be seen. */
  clock_gap_ms: number | null;
  clock_late_ms: number | null;
  /** How often the page was hidden or lost focus. */
  focus_lost: number;
  /** What disturbed it, by name, and how often. */
  disturbances: Record<string, number>;
  /** Smallest share of the clip inside the window. */
  visible_share: number;
  /** Frames that the browser presented without reporting when: how many, by the next frame that it reported. */
  unlogged?: ReadonlyMap<number, number>;
  /** False where the browser does not report which frames it draws: how many are missing is then unknown. */
  logs_frames?: boolean;
  /** Mean time between refreshes meanwhile, those missed left out; null where it could not be seen. */
  refresh_ms: number | null;
}

export interface Screen {
  refresh_rate_hz: number | null;
  device_pixel_ratio: number | null;
}

const ASSUMED_REFRESH_MS = 1000 / 60;
/** Scheduling jitter of a time stamp that does not count as lateness. */
const JITTER_MS = 2;

/** The record of all showings of a trial: counts are totals, `drawn` counts from each showing's start key. */
export function playbackRecord(clip_sha256: string | null, showings: Showing[], screen: Screen): PlaybackRecord {
  const believed_ms = screen.refresh_rate_hz ? 1000 / screen.refresh_rate_hz : ASSUMED_REFRESH_MS;
  const first = showings[0];
  const first_drawn = first?.drawn[0];
  const gaps = showings.flatMap(gapsOf);
  const is_logged = showings.every(({ logs_frames }) => logs_frames !== false);
  const logged = (value: () => number): number | null => (is_logged ? count(value()) : null);
  return {
    method: first ? worst(showings) : "none",
    clip_sha256,
    clips: null,
    key_to_first_frame_ms: first && first_drawn ? duration(first_drawn[1] - first.key_at_ms) : null,
    frames_drawn: logged(() => sum(showings.map((showing) => distinct(showing)))),
    frames_late: logged(() => sum(showings.map((showing) => late(showing, believed_ms)))),
    frames_missing: logged(() => sum(showings.map((showing) => Math.max(0, showing.frames - distinct(showing))))),
    longest_gap_ms: gaps.length && is_logged ? duration(Math.max(...gaps)) : null,
    clock_gap_ms: duration(greatest(showings.map((showing) => showing.clock_gap_ms))),
    clock_late_ms: offset(greatest(showings.map((showing) => showing.clock_late_ms))),
    stalls: count(sum(showings.map((showing) => showing.stalls))),
    focus_lost: count(sum(showings.map((showing) => showing.focus_lost))),
    disturbances: disturbancesOf(showings),
    device_pixel_ratio: within(screen.device_pixel_ratio, 0.01, 100),
    refresh_rate_hz: within(rateShownAt(showings, screen.refresh_rate_hz), 0, 10_000),
    drawn: frameLog(
      showings.flatMap(({ drawn, key_at_ms }) => drawn.map(([index, at_ms]): [number, number] => [index, at_ms - key_at_ms])),
    ),
  };
}

/** What disturbed any of the showings, and how often in all. */
export function disturbancesOf(showings: readonly Pick<Showing, "disturbances">[]): Record<string, number> {
  const total: Record<string, number> = {};
  for (const { disturbances } of showings) {
    for (const [name, count] of Object.entries(disturbances)) total[name] = (total[name] ?? 0) + count;
  }
  return total;
}

/** The measured rate, or that of the fastest showing if that shows a faster screen; null if no rate was measured. */
function rateShownAt(showings: readonly Showing[], measured_hz: number | null): number | null {
  if (!measured_hz) return null;
  const shortest_ms = Math.min(...showings.map((showing) => trueRefresh(showing.refresh_ms, 1000 / measured_hz)));
  return shortest_ms < 1000 / measured_hz ? Math.round(10_000 / shortest_ms) / 10 : measured_hz;
}

/**
 * Frames drawn more than a refresh away from their time; early ones too, as where a clip ran fast. The refresh is the one
 * measured during the clip. If the page missed refreshes and so measured a longer one, that allows no extra delay.
 */
function late({ method, drawn, fps, refresh_ms }: Showing, believed_ms: number): number {
  const start = drawn[0];
  if (!start) return 0;
  const period_ms = shownPeriod(1000 / fps, refresh_ms ?? believed_ms);
  // The shorter of both: a page that missed refreshes must not be allowed more for it.
  const allowed_ms = Math.min(refresh_ms ?? believed_ms, believed_ms) + JITTER_MS;
  const began_ms = drawn.map(([index, at_ms]) => at_ms - index * period_ms);
  // A video element holds its first frame for some time until it runs: most frames show when it began to.
  const clip_at_ms = (method === "video" ? median(began_ms) : began_ms[0]) ?? 0;
  return began_ms.filter((one) => Math.abs(one - clip_at_ms) > allowed_ms).length;
}

/** Between one frame and the next; those presented in between without a report have their share of the time. */
function gapsOf({ drawn, unlogged }: Showing): number[] {
  return drawn.slice(1).map(([index, at_ms], row) => (at_ms - (drawn[row]?.[1] ?? at_ms)) / (1 + (unlogged?.get(index) ?? 0)));
}

const median = (values: number[]): number | undefined => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];
const distinct = ({ drawn, unlogged }: Showing): number =>
  new Set(drawn.map(([index]) => index)).size + sum([...(unlogged?.values() ?? [])]);
const sum = (numbers: number[]): number => numbers.reduce((total, number) => total + number, 0);
/** Null where one of them is: what was not seen once is not known. */
const greatest = (values: (number | null)[]): number | null =>
  values.length === 0 || values.includes(null) ? null : Math.max(...values.map((value) => value ?? 0));
const worst = (showings: Showing[]): PlaybackMethod => showings.find((showing) => showing.method !== "webcodecs")?.method ?? "webcodecs";
