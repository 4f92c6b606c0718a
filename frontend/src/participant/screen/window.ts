/** The window of the run: its focus, full screen, one tab, refresh rate and clock. */
import { meanGap } from "../playback/protocol";

// Whether the page had the participant's window all the time.

export interface Watch {
  stop: () => number;
}

/** From now until `stop`, which returns how often the page was hidden or lost focus meanwhile. */
export function watchFocus(): Watch {
  let lost = document.hidden ? 1 : 0;
  const losing = (): void => void (lost += 1);
  const hiding = (): void => void (lost += document.hidden ? 1 : 0);
  window.addEventListener("blur", losing);
  document.addEventListener("visibilitychange", hiding);
  return {
    stop: () => {
      window.removeEventListener("blur", losing);
      document.removeEventListener("visibilitychange", hiding);
      return lost;
    },
  };
}

// Full screen as the page or the browser's own key makes it.

export function canFullScreen(): boolean {
  return document.fullscreenEnabled;
}

export function isFullScreen(): boolean {
  // F11 fills the screen without telling the page.
  return document.fullscreenElement !== null || window.innerHeight >= screen.height - 2;
}

/** True where the browser granted it. Must be called from a click or key. */
export async function enterFullScreen(): Promise<boolean> {
  try {
    await document.documentElement.requestFullscreen({ navigationUI: "hide" });
    return true;
  } catch {
    return false;
  }
}

export async function leaveFullScreen(): Promise<void> {
  if (document.fullscreenElement) await document.exitFullscreen().catch(() => {});
}

// One tab at a time, by a Web Lock: a second one gets a message, and may take over.

export type Claim = "held" | "elsewhere";

/** A browser that answers within this time has locks. */
const ANSWER_LIMIT_MS = 3_000;

/**
 * Claim the run. `onTaken` is called when another tab takes it away. Where the browser has no locks, refuses them (as with
 * blocked cookies) or does not answer, nothing is known of other tabs and the visit goes on: the server still keeps each
 * answer once.
 */
export function claimTab(name: string, take: boolean, onTaken: () => void, limit_ms = ANSWER_LIMIT_MS): Promise<Claim> {
  return new Promise((resolve) => {
    let has_lock = false;
    setTimeout(resolve, limit_ms, "held");
    // The lock lasts as long as this promise: until the page goes, or another tab steals it.
    const options: LockOptions = take ? { steal: true } : { ifAvailable: true };
    const hold = (lock: Lock | null): Promise<void> | void => {
      if (!lock) return resolve("elsewhere");
      has_lock = true;
      resolve("held");
      return new Promise<void>(() => {});
    };
    const failed = (): void => (has_lock ? onTaken() : resolve("held"));
    try {
      Promise.resolve(navigator.locks.request(name, options, hold)).catch(failed);
    } catch {
      failed();
    }
  });
}

// The screen's refresh rate in Hz, from the mean interval of animation frames.

const FRAMES = 60;
const LIMIT_MS = 3_000;

function measureRefreshRate(): Promise<number | null> {
  return new Promise((resolve) => {
    const stamps: number[] = [];
    const done = (): void => {
      clearTimeout(limit);
      resolve(refreshRate(stamps));
    };
    const limit = setTimeout(done, LIMIT_MS);
    const tick = (now: number): void => {
      stamps.push(now);
      if (stamps.length <= FRAMES) requestAnimationFrame(tick);
      else done();
    };
    requestAnimationFrame(tick);
  });
}

/** Measures now, and again each time the page is looked at until the rate is known: a hidden page gets no refreshes. */
export async function untilMeasured(
  page: Document,
  report: (rate: number | null) => unknown,
  over: AbortSignal,
  measure = measureRefreshRate,
): Promise<void> {
  // Listened for from now on: the page may be looked at while this measurement fails.
  const looked = lookedAt(page, over);
  const rate = await measure();
  if (over.aborted) return;
  report(rate);
  if (rate === null && (await looked)) await untilMeasured(page, report, over, measure);
}

/** False where the run is over before that. */
function lookedAt(page: Document, over: AbortSignal): Promise<boolean> {
  return new Promise((resolve) => {
    const look = (): void => {
      if (page.visibilityState === "visible") resolve(true);
    };
    page.addEventListener("visibilitychange", look, { signal: over });
    over.addEventListener("abort", () => resolve(false), { once: true });
  });
}

/** Null where there are too few stamps, for instance in a hidden page. Missed refreshes are left out. */
export function refreshRate(stamps: readonly number[]): number | null {
  const mean = stamps.length > 10 ? meanGap(stamps) : null;
  return mean && Math.round(10_000 / mean) / 10;
}

// Time in the run by the clock that cannot be set, and a look at whether the other one was.

const SET_BY_MS = 2_000;

export class RunClock {
  private readonly started_ms = performance.now();
  private offset_ms = Date.now() - performance.now();

  constructor(private readonly before_ms: number) {}

  /** Milliseconds that pages of the run have been open, time between them left out. */
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
