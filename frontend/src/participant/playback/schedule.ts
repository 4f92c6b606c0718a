/**
 * Which frame to draw at a screen refresh.
 *
 * Frame k is due k periods after frame 0 was drawn, and is drawn at the refresh nearest to that. After a hold-up
 * it goes on at the frame that is due: those in between are missing, and the rest of the clip is in time.
 *
 * Where a frame's period is nearly a whole number of refreshes (60 fps on a screen of 59 Hz), each frame gets that
 * number: the clip runs slower or faster by the difference, instead of losing a frame now and then.
 */

/** Up to this share of the period, the clip follows the screen. */
const LOCKED_WITHIN = 0.03;

/** The time a frame is shown for on a screen with that time between refreshes. */
export function shownPeriod(declared_period_ms: number, refresh_ms: number): number {
  const locked_ms = Math.max(1, Math.round(declared_period_ms / refresh_ms)) * refresh_ms;
  const is_locked = Math.abs(locked_ms - declared_period_ms) <= LOCKED_WITHIN * declared_period_ms;
  return is_locked ? locked_ms : declared_period_ms;
}

export class FrameSchedule {
  private first_ms: number | null = null;
  private last = -1;
  private readonly period_ms: number;

  constructor(
    private readonly frames: number,
    declared_period_ms: number,
    private readonly refresh_ms: number,
  ) {
    this.period_ms = shownPeriod(declared_period_ms, refresh_ms);
  }

  /** Index of the frame to draw at the refresh of time `now_ms`, or null where the picture stays. */
  next(now_ms: number): number | null {
    if (this.first_ms === null) {
      this.first_ms = now_ms;
      return (this.last = 0);
    }
    const due = Math.min(this.frames - 1, Math.floor((now_ms - this.first_ms + this.refresh_ms / 2) / this.period_ms));
    return due <= this.last ? null : (this.last = due);
  }

  /** True when the last frame has been shown for its period. */
  isOver(now_ms: number): boolean {
    if (this.first_ms === null || this.last < this.frames - 1) return false;
    return now_ms - this.first_ms + this.refresh_ms / 2 >= this.frames * this.period_ms;
  }
}
