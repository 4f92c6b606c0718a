/** What the engine needs to know; the defaults are those of the Python package, each with its source. */
import shipped from "../../../blink_engine/defaults.json";
import { type Law, mean, withMean } from "./laws";

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
