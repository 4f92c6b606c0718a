/** The screen's refresh rate in Hz, from the mean interval of animation frames. */
import { meanGap } from "../playback/refresh-clock";

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
  tell: (rate: number | null) => unknown,
  over: AbortSignal,
  measure = measureRefreshRate,
): Promise<void> {
  // Listened for from now on: the page may be looked at while this measurement fails.
  const looked = lookedAt(page, over);
  const rate = await measure();
  if (over.aborted) return;
  tell(rate);
  if (rate === null && (await looked)) await untilMeasured(page, tell, over, measure);
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

/** Null where there are too few stamps to tell, for instance in a hidden page. Missed refreshes are left out. */
export function refreshRate(stamps: readonly number[]): number | null {
  const mean = stamps.length > 10 ? meanGap(stamps) : null;
  return mean && Math.round(10_000 / mean) / 10;
}
