/** The screen's refresh rate in Hz, from the median interval of animation frames. */

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

/** Null where there are too few stamps to tell, for instance in a hidden page. */
export function refreshRate(stamps: readonly number[]): number | null {
  const gaps = stamps
    .slice(1)
    .map((stamp, place) => stamp - (stamps[place] ?? stamp))
    .sort((a, b) => a - b);
  const median = gaps[Math.floor(gaps.length / 2)];
  return gaps.length < 10 || !median ? null : Math.round((1000 / median) * 10) / 10;
}
