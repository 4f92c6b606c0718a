/**
 * What a browser reports, checked where it is taken: a number that no clock or screen can have is unknown (null).
 * The bounds are those of the server's models.
 */

const MAX_MS = 1e10;
const MAX_COUNT = 1_000_000;
const MAX_PX = 100_000;
const EARLIEST_MS = 0;
const LATEST_MS = Date.UTC(9000, 0, 1);

/** The number if it lies between the bounds; null otherwise, also for what is not a number. */
export function within(value: unknown, low: number, high: number): number | null {
  return typeof value === "number" && Number.isFinite(value) && value >= low && value <= high ? value : null;
}

/** A length of time in ms, to 0.01 ms. */
export function duration(ms: unknown): number | null {
  const known = within(ms, 0, MAX_MS);
  return known === null ? null : Math.round(known * 100) / 100;
}

/** A time in ms before or after another moment, to 0.01 ms. */
export function offset(ms: unknown): number | null {
  const known = within(ms, -MAX_MS, MAX_MS);
  return known === null ? null : Math.round(known * 100) / 100;
}

/** How often something was, as a whole number. */
export function count(value: unknown): number | null {
  const known = within(value, 0, MAX_COUNT);
  return known === null ? null : Math.round(known);
}

/** A side of a window or screen in whole CSS pixels; 0 where it is unknown. */
export const pixels = (value: unknown): number => Math.round(within(value, 0, MAX_PX) ?? 0);

/** The pixel ratio; null where the browser reports none. */
export const pixelRatio = (value: unknown): number | null => within(value, 0.01, 100);

/** This moment by the device's clock, null where the clock cannot be right. */
export function clockTime(now_ms: number = Date.now()): string | null {
  const known = within(now_ms, EARLIEST_MS, LATEST_MS - 1);
  return known === null ? null : new Date(known).toISOString();
}

/** A log of drawn frames without the entries that say nothing. */
export function frameLog(log: readonly (readonly [number, number])[]): [number, number][] {
  return log.flatMap(([index, ms]): [number, number][] => {
    const [frame, at] = [count(index), offset(ms)];
    return frame === null || at === null ? [] : [[frame, at]];
  });
}
