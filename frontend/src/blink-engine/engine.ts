/** One call a frame: the lids at a moment. No dependencies, no allocation but the frame, bounded memory. */
import {
  draw,
  drawUnderWay,
  type BlinkEvent,
  drifted,
  meanInterval_s,
  type Parameters,
  responseChance,
  type StateName,
  DEFAULT_PARAMETERS,
} from "./parameters";
import { RandomNumbers } from "./random-numbers";

// The course of one blink, as in blink_engine/plan.py (equations 1 to 3 there).

interface BlinkShape {
  closing_s: number;
  closed_s: number;
  opening_s: number;
  closing_power: number;
  opening_power: number;
}

const smooth = (u: number): number => u * u * u * (10 + u * (6 * u - 15));

const duration = (shape: BlinkShape): number => shape.closing_s + shape.closed_s + shape.opening_s;

/** How far the lid is on its way, 0 to 1, at one moment after the onset. */
function courseAt(shape: BlinkShape, time_s: number): number {
  if (time_s <= 0 || time_s >= duration(shape)) return 0;
  if (time_s < shape.closing_s) return smooth((time_s / shape.closing_s) ** shape.closing_power);
  const since = time_s - shape.closing_s - shape.closed_s;
  if (since <= 0) return 1;
  return 1 - smooth(Math.min(1, since / shape.opening_s) ** shape.opening_power);
}

// When the next blink comes and what it looks like, as in blink_engine/plan.py: same draws, in the same order.

const INTERVALS = 1;
const SHAPES = 2;
const RESPONSES = 3;
const DRIFTS = 4;
const ANTICIPATED_MAX = 2;
const LONGEST_CLOSED_SPREADS = 2;

interface Blink {
  left_onset_s: number;
  right_onset_s: number;
  left_peak: number;
  right_peak: number;
  shape: BlinkShape;
  cause: string;
}

const endOf = (blink: Blink): number => Math.max(blink.left_onset_s, blink.right_onset_s) + duration(blink.shape);

const bounded = (value: number): number => Math.min(1, Math.max(0, value));

class BlinkPlan {
  private readonly intervals: RandomNumbers;
  private readonly shapes: RandomNumbers;
  private readonly responses: RandomNumbers;
  private readonly drifts: RandomNumbers;
  private drift: number;
  private slow: number;
  private lastOnset_s = -Infinity;
  private spontaneous_s: number;
  private answer_s = Infinity;
  private answerCause = "";
  private anticipated = 0;
  private held = false;

  constructor(
    private readonly parameters: Parameters,
    private state: StateName,
    seed: number,
  ) {
    this.intervals = new RandomNumbers(seed, INTERVALS);
    this.shapes = new RandomNumbers(seed, SHAPES);
    this.responses = new RandomNumbers(seed, RESPONSES);
    this.drifts = new RandomNumbers(seed, DRIFTS);
    this.drift = this.underWay(parameters.drift.spread);
    this.slow = this.underWay(parameters.slow_drift.spread);
    const met = this.drifted(drawUnderWay(parameters.intervals[state], this.intervals));
    this.spontaneous_s = met * this.intervals.uniform();
  }

  setState(state: StateName, time_s: number): void {
    const ratio = meanInterval_s(this.parameters, state) / meanInterval_s(this.parameters, this.state);
    this.spontaneous_s = time_s + Math.max(0, this.spontaneous_s - time_s) * ratio;
    this.state = state;
  }

  notify({ kind, time_s, amplitude_deg = 0 }: BlinkEvent): void {
    if (kind === "blink") return this.answer(time_s, kind);
    const response = this.parameters.responses[kind];
    const chance = this.responses.uniform();
    const latency = this.responses.uniform();
    if (chance >= responseChance(response, amplitude_deg)) return;
    const delay = response.earliest_s + latency * (response.latest_s - response.earliest_s);
    this.answer(time_s + Math.max(0, delay), kind);
  }

  hold(): void {
    this.held = true;
  }

  /** What was due while blinks were held comes at once, as one blink. */
  release(time_s: number): void {
    this.held = false;
    this.spontaneous_s = Math.max(this.spontaneous_s, time_s);
    this.answer_s = Math.max(this.answer_s, time_s);
  }

  /** Hands every blink that begins at or before `until_s` to `take`, in order, each once. */
  due(until_s: number, take: (blink: Blink) => void): void {
    while (!this.held && Math.min(this.spontaneous_s, this.answer_s) <= until_s) {
      if (this.answer_s <= this.spontaneous_s) this.takeAnswer(take);
      else this.takeSpontaneous(take);
    }
  }

  private takeAnswer(take: (blink: Blink) => void): void {
    const onset_s = this.answer_s;
    this.answer_s = Infinity;
    this.anticipated = Math.min(ANTICIPATED_MAX, this.anticipated + 1);
    take(this.blink(onset_s, this.answerCause));
  }

  private takeSpontaneous(take: (blink: Blink) => void): void {
    const onset_s = this.spontaneous_s;
    this.spontaneous_s = onset_s + this.interval();
    if (this.anticipated > 0) this.anticipated -= 1;
    else if (onset_s >= this.lastOnset_s + this.parameters.least_interval_s) take(this.blink(onset_s, "spontaneous"));
  }

  private answer(onset_s: number, cause: string): void {
    const onset = Math.max(onset_s, this.lastOnset_s + this.parameters.least_interval_s);
    if (onset >= this.answer_s) return;
    this.answer_s = onset;
    this.answerCause = cause;
  }

  private interval(): number {
    return this.drifted(draw(this.parameters.intervals[this.state], this.intervals));
  }

  /** A drift at a random moment, which falls into long intervals. */
  private underWay(spread: number): number {
    return spread * spread + spread * this.drifts.normal();
  }

  /** Applies the drifts to an interval, and takes them to the next one. */
  private drifted(drawn_s: number): number {
    const { intervals, drift, slow_drift, least_interval_s } = this.parameters;
    const interval_s = intervals[this.state].kind === "fixed" ? drawn_s : drawn_s * Math.exp(this.drift + this.slow);
    this.drift = drifted(drift, this.drift, this.drifts.normal());
    this.slow = drifted(slow_drift, this.slow, this.drifts.normal());
    return Math.max(interval_s, least_interval_s);
  }

  private blink(onset_s: number, cause: string): Blink {
    const { profile } = this.parameters;
    const numbers = this.shapes;
    const kind = numbers.uniform();
    const partial = numbers.normal();
    const closing_s = draw(profile.closing_s, numbers);
    const opening_s = draw(profile.opening_s, numbers);
    const drawnClosed = numbers.normal();
    const asymmetry = profile.asymmetry * numbers.normal();
    const delay_s = profile.delay_s * numbers.normal();
    const again = numbers.uniform() < profile.double_share;
    const complete = kind < profile.long_share + profile.complete_share;
    const long = kind < profile.long_share;
    const law = long ? profile.long_closed_s : profile.closed_s;
    const closed = long || drawnClosed <= LONGEST_CLOSED_SPREADS ? drawnClosed : 2 * LONGEST_CLOSED_SPREADS - drawnClosed;
    const closed_s = complete ? law.median * Math.exp((law.spread ?? 0) * closed) : 0;
    const peak = complete ? 1 : 1 / (1 + Math.exp(-(profile.partial_logit_median + profile.partial_logit_spread * partial)));
    const { closing_power, opening_power } = profile;
    const shape = { closing_s, closed_s, opening_s, closing_power, opening_power };
    this.lastOnset_s = onset_s;
    if (again && cause !== "double") this.answer(onset_s + duration(shape), "double");
    return {
      left_onset_s: onset_s + Math.max(0, -delay_s),
      right_onset_s: onset_s + Math.max(0, delay_s),
      left_peak: complete ? peak : bounded(peak + asymmetry / 2),
      right_peak: complete ? peak : bounded(peak - asymmetry / 2),
      shape,
      cause,
    };
  }
}

const GAZE_CLOSURE_MIN = -0.15;
const GAZE_CLOSURE_MAX = 0.6;

/** Closures 0 (open) to 1 (closed); the lower lid's way up and in, 0 to 1 of its full travel. */
export interface LidFrame {
  left: number;
  right: number;
  left_lower_up: number;
  right_lower_up: number;
  left_lower_in: number;
  right_lower_in: number;
}

export interface EngineOptions {
  seed?: number;
  state?: StateName;
  parameters?: Parameters;
}

export class BlinkEngine {
  readonly parameters: Parameters;
  private readonly plan: BlinkPlan;
  private active: Blink[] = [];
  private time_s = 0;

  constructor({ seed = 0, state = "rest", parameters = DEFAULT_PARAMETERS }: EngineOptions = {}) {
    this.parameters = parameters;
    this.plan = new BlinkPlan(parameters, state, seed);
  }

  /** Enter a state, at the moment of the last frame where no later one is named. */
  setState(state: StateName, time_s?: number): void {
    this.plan.setState(state, this.reach(time_s ?? this.time_s));
  }

  /** Report an event, in the order of time; one in the past counts as happening at the last frame. */
  notify(event: BlinkEvent): void {
    this.plan.notify({ ...event, time_s: this.reach(event.time_s) });
  }

  /**
   * Hold blinks back while a flag of yours is up (true), and blink again once it is down (false). A blink that has begun
   * finishes; one that was due meanwhile begins when the flag goes down.
   */
  holdBlinks(held: boolean, time_s?: number): void {
    const reached = this.reach(time_s ?? this.time_s);
    if (held) this.plan.hold();
    else this.plan.release(reached);
  }

  /** The lids at `time_s`, which must not run backwards; gaze below the horizon in degrees, squint 0 to 1. */
  frame(time_s: number, gaze_down_deg = 0, squint = 0): LidFrame {
    if (!(time_s >= this.time_s) || time_s === Infinity) {
      throw new RangeError(`expected a time of at least ${this.time_s} s, got ${time_s}`);
    }
    this.time_s = time_s;
    this.plan.due(time_s, this.keep);
    if (this.active.some((blink) => endOf(blink) <= time_s)) this.active = this.active.filter((blink) => endOf(blink) > time_s);
    return this.lids(this.resting(gaze_down_deg, squint), Math.min(1, Math.max(0, squint)));
  }

  private readonly keep = (blink: Blink): void => void this.active.push(blink);

  /** Plans up to a happening: what began before it is not its to move. */
  private reach(time_s: number): number {
    const reached = Math.max(time_s, this.time_s);
    this.plan.due(reached, this.keep);
    return reached;
  }

  private resting(gaze_down_deg: number, squint: number): number {
    const covered = Math.min(GAZE_CLOSURE_MAX, Math.max(GAZE_CLOSURE_MIN, this.parameters.gaze_closure_per_deg * gaze_down_deg));
    return covered + (1 - covered) * this.parameters.squint_closure * Math.min(1, Math.max(0, squint));
  }

  private lids(resting: number, squint: number): LidFrame {
    let left = 0;
    let right = 0;
    for (const blink of this.active) {
      left = Math.max(left, blink.left_peak * courseAt(blink.shape, this.time_s - blink.left_onset_s));
      right = Math.max(right, blink.right_peak * courseAt(blink.shape, this.time_s - blink.right_onset_s));
    }
    const { lower_up, lower_in } = this.parameters.profile;
    return {
      left: Math.max(resting, resting + (1 - resting) * left),
      right: Math.max(resting, resting + (1 - resting) * right),
      left_lower_up: Math.max(squint, lower_up * left),
      right_lower_up: Math.max(squint, lower_up * right),
      left_lower_in: lower_in * left,
      right_lower_in: lower_in * right,
    };
  }
}
