/** The screen's refresh rate in Hz, from the mean interval of animation frames. */

const FRAMES = 60;
const LIMIT_MS = 3_000;

export function measureRefreshRate(): Promise<number | null> {
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

/** Null where there are too few stamps to tell, for instance in a hidden page. Missed refreshes are left out. */
export function refreshRate(stamps: readonly number[]): number | null {
  const gaps = stamps.slice(1).map((stamp, index) => stamp - (stamps[index] ?? stamp));
  const median = [...gaps].sort((a, b) => a - b)[Math.floor(gaps.length / 2)];
  if (gaps.length < 10 || !median) return null;
  // Time stamps may be rounded to a whole millisecond, so that the mean tells more than the median.
  const regular = gaps.filter((gap) => Math.abs(gap - median) < median / 4);
  const mean = regular.reduce((total, gap) => total + gap, 0) / regular.length;
  return Math.round(10_000 / mean) / 10;
}
