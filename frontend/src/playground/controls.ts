/** One control for each number the engine draws by. */
import { DEFAULT_PARAMETERS, type Parameters, STATE_NAMES } from "../blink-engine";

export interface Control {
  /** Where the number stands in `Parameters`, such as `profile.closing_s.median`. */
  path: string;
  label: string;
  group: string;
  min: number;
  max: number;
  step: number;
}

interface Range {
  min: number;
  max: number;
  step: number;
}

const SHARE: Range = { min: 0, max: 1, step: 0.01 };
const GROUPS: Readonly<Record<string, string>> = {
  intervals: "Time between blinks",
  drift: "Time between blinks",
  slow_drift: "Time between blinks",
  responses: "Answers to events",
  profile: "One blink",
};
/** Gamma shapes of intervals: 1 is a Poisson process, a great one a clock. */
const SHAPE: Range = { min: 0.3, max: 30, step: 0.1 };
/** By the last part of the path, or the last two where one is not enough. */
const RANGES: Readonly<Record<string, Range>> = {
  ...Object.fromEntries(STATE_NAMES.map((state) => [`${state}.spread`, SHAPE])),
  "closing_s.median": { min: 0.03, max: 0.5, step: 0.005 },
  "opening_s.median": { min: 0.05, max: 1, step: 0.005 },
  "closed_s.median": { min: 0, max: 0.5, step: 0.005 },
  "long_closed_s.median": { min: 0.1, max: 2, step: 0.01 },
  median: { min: 0.3, max: 60, step: 0.1 },
  spread: { min: 0, max: 2, step: 0.01 },
  kept: { min: 0, max: 0.999, step: 0.001 },
  probability: SHARE,
  earliest_s: { min: 0, max: 2, step: 0.005 },
  latest_s: { min: 0, max: 2, step: 0.005 },
  midpoint_deg: { min: 0, max: 60, step: 0.5 },
  slope_deg: { min: 0.5, max: 20, step: 0.1 },
  closing_power: { min: 0.4, max: 3, step: 0.01 },
  opening_power: { min: 0.4, max: 3, step: 0.01 },
  complete_share: SHARE,
  long_share: SHARE,
  double_share: SHARE,
  partial_logit_median: { min: -3, max: 6, step: 0.05 },
  partial_logit_spread: { min: 0, max: 3, step: 0.05 },
  asymmetry: { min: 0, max: 0.5, step: 0.005 },
  delay_s: { min: 0, max: 0.1, step: 0.001 },
  lower_up: SHARE,
  lower_in: SHARE,
  least_interval_s: { min: 0, max: 3, step: 0.05 },
  gaze_closure_per_deg: { min: 0, max: 0.05, step: 0.001 },
  squint_closure: SHARE,
};

/** Paths of all numbers in a tree of objects. */
export function numberPaths(tree: object, before = ""): string[] {
  return Object.entries(tree).flatMap(([key, value]: [string, unknown]) => {
    const path = before + key;
    if (typeof value === "number") return [path];
    return typeof value === "object" && value !== null ? numberPaths(value, `${path}.`) : [];
  });
}

function controlOf(path: string): Control {
  const parts = path.split(".");
  const range = RANGES[parts.slice(-2).join(".")] ?? RANGES[parts.at(-1) ?? ""];
  if (range === undefined) throw new Error(`expected a range for ${path}; add one to RANGES`);
  const [first = "", ...rest] = parts;
  const named = first === "intervals" ? [...rest.slice(0, -1), range === SHAPE ? "shape" : "median_s"] : rest;
  const label = (rest.length > 0 && !first.endsWith("drift") ? named : parts)
    .join(" ")
    .replaceAll("_s", " (s)")
    .replaceAll("_deg", " (°)")
    .replaceAll("_", " ");
  return { path, label, group: GROUPS[first] ?? "Lid and gaze", ...range };
}

export const CONTROLS: readonly Control[] = numberPaths(DEFAULT_PARAMETERS)
  .filter((path) => !path.startsWith("responses.blink."))
  .map(controlOf);

export function valueAt(parameters: Parameters, path: string): number {
  let value: unknown = parameters;
  for (const key of path.split(".")) value = (value as Record<string, unknown>)[key];
  return value as number;
}

/** The same with one number changed; what lies beside the path is shared. */
export function withValue(parameters: Parameters, path: string, value: number): Parameters {
  const changed = (tree: object, [key = "", ...rest]: readonly string[]): object => ({
    ...tree,
    [key]: rest.length === 0 ? value : changed((tree as Record<string, object>)[key] ?? {}, rest),
  });
  return changed(parameters, path.split(".")) as Parameters;
}
