/** Time in the run by the clock that cannot be set, and a look at whether the other one was. */

const SET_BY_MS = 2_000;

export class RunClock {
  private readonly started_ms = performance.now();
  private offset_ms = Date.now() - performance.now();

  constructor(private readonly before_ms: number) {}

  /** Milliseconds since the run began, time between visits left out. */
  elapsed(): number {
    return Math.round(this.before_ms + performance.now() - this.started_ms);
  }

  /** By how much the computer's clock was set (or the computer slept) since the last look; 0 where not. */
  shift(): number {
    const offset_ms = Date.now() - performance.now();
    const shift_ms = Math.round(offset_ms - this.offset_ms);
    if (Math.abs(shift_ms) < SET_BY_MS) return 0;
    this.offset_ms = offset_ms;
    return shift_ms;
  }
}
