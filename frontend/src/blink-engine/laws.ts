/** The distributions the engine draws from, as in blink_engine/laws.py. */
import type { RandomNumbers } from "./random-numbers";

export interface Law {
  kind: "lognormal" | "gamma" | "fixed";
  median: number;
  /** Standard deviation of the logarithm, or the gamma shape. */
  spread?: number;
}

export function draw({ kind, median, spread = 0 }: Law, numbers: RandomNumbers): number {
  if (kind === "gamma") return gammaScale(median, spread) * drawGamma(spread, numbers);
  const z = numbers.normal();
  return kind === "fixed" ? median : median * Math.exp(spread * z);
}

/** The interval that a random moment falls into: the longer one is, the likelier it is met. */
export function drawUnderWay(law: Law, numbers: RandomNumbers): number {
  const { kind, median, spread = 0 } = law;
  if (kind === "gamma") return gammaScale(median, spread) * drawGamma(spread + 1, numbers);
  const drawn = draw(law, numbers);
  return kind === "fixed" ? drawn : drawn * Math.exp(spread * spread);
}

export function mean({ kind, median, spread = 0 }: Law): number {
  if (kind === "gamma") return gammaScale(median, spread) * spread;
  return kind === "lognormal" ? median * Math.exp((spread * spread) / 2) : median;
}

export const withMean = (law: Law, value: number): Law => ({ ...law, median: (law.median * value) / mean(law) });

const gammaScale = (median: number, shape: number): number => median / (shape * (1 - 1 / (9 * shape)) ** 3);

/** Marsaglia & Tsang (2000), ACM TOMS 26(3), 363-372. */
function drawGamma(shape: number, numbers: RandomNumbers): number {
  if (shape < 1) {
    const boost = numbers.uniform() ** (1 / shape);
    return boost * drawGamma(shape + 1, numbers);
  }
  const d = shape - 1 / 3;
  const c = 1 / Math.sqrt(9 * d);
  for (;;) {
    const x = numbers.normal();
    const u = numbers.uniform();
    const v = (1 + c * x) ** 3;
    if (v > 0 && Math.log(u) < 0.5 * x * x + d - d * v + d * Math.log(v)) return d * v;
  }
}
