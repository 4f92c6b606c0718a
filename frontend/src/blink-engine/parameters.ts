/** What the engine needs to know; the defaults are those of the Python package, each with its source. */
import type { RandomNumbers } from "./random-numbers";
import shipped from "../../../blink_engine/defaults.json";

// The distributions the engine draws from, as in blink_engine/laws.py.

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

function mean({ kind, median, spread = 0 }: Law): number {
  if (kind === "gamma") return gammaScale(median, spread) * spread;
  return kind === "lognormal" ? median * Math.exp((spread * spread) / 2) : median;
}

const withMean = (law: Law, value: number): Law => ({ ...law, median: (law.median * value) / mean(law) });

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

export type StateName = "rest" | "reading" | "screen" | "speaking" | "listening";
type ReactingKind = "utterance_start" | "utterance_end" | "pause" | "turn_end" | "gaze_shift" | "head_turn";
export type EventKind = ReactingKind | "blink";

export const STATE_NAMES: readonly StateName[] = ["rest", "reading", "screen", "speaking", "listening"];

/** Something that happened at `time_s`; `amplitude_deg` is the size of a gaze shift or head turn. */
export interface BlinkEvent {
  kind: EventKind;
  time_s: number;
  amplitude_deg?: number;
}

/** A blink answers with this probability (growing with the movement where `midpoint_deg` is positive) after a uniform latency. */
export interface Response {
  probability: number;
  earliest_s: number;
  latest_s: number;
  midpoint_deg?: number;
  slope_deg?: number;
}

export interface ProfileModel {
  closing_s: Law;
  opening_s: Law;
  closed_s: Law;
  long_closed_s: Law;
  closing_power: number;
  opening_power: number;
  complete_share: number;
  long_share: number;
  double_share: number;
  partial_logit_median: number;
  partial_logit_spread: number;
  asymmetry: number;
  delay_s: number;
  lower_up: number;
  lower_in: number;
}

/** How somebody's rate wanders: each interval is the law's draw times e to the power of d, an autoregressive number. */
export interface Drift {
  /** Standard deviation of d. */
  spread: number;
  /** What is kept of d from one blink to the next. */
  kept: number;
}

export interface Parameters {
  intervals: Record<StateName, Law>;
  /** Over some blinks, and over minutes; both apply, but to laws of the kind `fixed`. */
  drift: Drift;
  slow_drift: Drift;
  responses: Record<EventKind, Response>;
  profile: ProfileModel;
  least_interval_s: number;
  gaze_closure_per_deg: number;
  squint_closure: number;
}

const { sources, ...values } = shipped;

export const DEFAULT_PARAMETERS = values as Parameters;
export const SOURCES: Readonly<Record<string, string>> = sources;

const driftMean = ({ spread }: Drift): number => Math.exp((spread * spread) / 2);

export const drifted = ({ spread, kept }: Drift, before: number, z: number): number =>
  kept * before + Math.sqrt(1 - kept * kept) * spread * z;

/** Mean time from onset to onset in a state, the drifts included. */
export function meanInterval_s({ intervals, drift, slow_drift }: Parameters, state: StateName): number {
  const law = intervals[state];
  return law.kind === "fixed" ? mean(law) : mean(law) * driftMean(drift) * driftMean(slow_drift);
}

/** The same with another mean blink rate in one state. */
export function withRate(parameters: Parameters, state: StateName, perMinute: number): Parameters {
  if (!(perMinute >= 0.1 && perMinute <= 60)) throw new RangeError(`expected a blink rate of 0.1 to 60 a minute, got ${perMinute}`);
  const before = parameters.intervals[state];
  const law = withMean(before, (mean(before) * 60) / perMinute / meanInterval_s(parameters, state));
  return { ...parameters, intervals: { ...parameters.intervals, [state]: law } };
}

export function responseChance({ probability, midpoint_deg = 0, slope_deg = 1 }: Response, amplitude_deg: number): number {
  return midpoint_deg <= 0 ? probability : 1 / (1 + Math.exp(-(Math.abs(amplitude_deg) - midpoint_deg) / slope_deg));
}
