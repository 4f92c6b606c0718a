/**
 * Which frame to draw at a screen refresh.
 *
 * Frame k is due k periods after frame 0 was drawn, and is drawn at the refresh nearest to that. After a short
 * hold-up the frames in between are still drawn in order, one a refresh, so that none is missing and those
 * are counted late; after a long one (more than CATCH_UP_FRAMES) it goes on at the frame that is due.
 */

const CATCH_UP_FRAMES = 4;

export class FrameSchedule {
  private first_ms: number | null = null;
  private last = -1;

  constructor(
    private readonly frames: number,
    private readonly period_ms: number,
    private readonly refresh_ms: number,
  ) {}

  /** Index of the frame to draw at the refresh of time `now_ms`, or null where the picture stays. */
  next(now_ms: number): number | null {
    if (this.first_ms === null) {
      this.first_ms = now_ms;
      return (this.last = 0);
    }
    const due = Math.min(this.frames - 1, Math.floor((now_ms - this.first_ms + this.refresh_ms / 2) / this.period_ms));
    if (due <= this.last) return null;
    this.last = due - this.last > CATCH_UP_FRAMES ? due : this.last + 1;
    return this.last;
  }

  /** True when the last frame has been shown for its period. */
  isOver(now_ms: number): boolean {
    if (this.first_ms === null || this.last < this.frames - 1) return false;
    return now_ms - this.first_ms + this.refresh_ms / 2 >= this.frames * this.period_ms;
  }
}
