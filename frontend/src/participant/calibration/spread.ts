/** How well repeated measurements agree, and where the next one begins. */

/** Repeats that differ by more, in percent of their mean, are followed by one more. */
export const SPREAD_MAX_PERCENT = 4;
/** So many more than declared; then the spread is what it is, and stored. */
const FURTHER = 2;

export function mean(values: readonly number[]): number {
  return values.reduce((total, value) => total + value, 0) / values.length;
}

/** Largest less smallest, in percent of the mean. */
export function spreadPercent(values: readonly number[]): number {
  return ((Math.max(...values) - Math.min(...values)) / mean(values)) * 100;
}

/** Standard deviation (n - 1); 0 of fewer than two. */
export function deviation(values: readonly number[]): number {
  if (values.length < 2) return 0;
  const middle = mean(values);
  return Math.sqrt(values.reduce((total, value) => total + (value - middle) ** 2, 0) / (values.length - 1));
}

/** The measurements that count: the last `repeats`. Null where one more is needed. */
export function settled(values: readonly number[], repeats: number): number[] | null {
  const last = values.slice(-repeats);
  if (last.length < repeats) return null;
  return spreadPercent(last) <= SPREAD_MAX_PERCENT || values.length >= repeats + FURTHER ? last : null;
}

/** A length to begin with, anywhere from `smallest` to `largest` but at least a tenth away from where the last one ended. */
export function randomStart(smallest: number, largest: number, last: number | null, random: () => number = Math.random): number {
  for (let tries = 0; tries < 20; tries += 1) {
    const start = smallest + (largest - smallest) * random();
    if (last === null || Math.abs(start - last) > last / 10) return start;
  }
  return smallest;
}
