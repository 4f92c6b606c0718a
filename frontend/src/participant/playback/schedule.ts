/**
 * Which frame to draw at a screen refresh.
 *
 * Frame k is due k periods after frame 0 was drawn, and is drawn at the refresh nearest to that. After a hold-up
 * it goes on at the frame that is due: those in between are missing, and the rest of the clip is in time.
 *
 * Where a frame's period is nearly a whole number of refreshes (60 fps on a screen of 59 Hz), each frame gets that
 * number: the clip runs slower or faster by the difference, instead of losing a frame now and then. Refreshes are counted
 * then, since the time between them may have been measured wrongly, or not yet.
 */

/** Up to this share of the period, the clip follows the screen. */
const LOCKED_WITHIN = 0.03;
const ROUNDING = 1e-6;

/** Refreshes that follow one another within less than this share of the time believed are those of a faster screen. */
const FASTER = 0.85;

/** The time between refreshes to go by: that which was seen, where the screen is faster than was believed. */
export function trueRefresh(seen_ms: number | null, believed_ms: number): number {
  return seen_ms !== null && seen_ms < FASTER * believed_ms ? seen_ms : believed_ms;
}

/** The time a frame is shown for on a screen with that time between refreshes. */
export function shownPeriod(declared_period_ms: number, refresh_ms: number): number {
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
    const step_ms = this.is_locked ? Math.round(passed_ms / refresh_ms) * refresh_ms : passed_ms;
    if (step_ms > 0) {
      this.before_ms = now_ms;
      this.elapsed_ms += step_ms;
    }
    return Math.floor((this.elapsed_ms + refresh_ms / 2) / this.period_ms);
  }
}
