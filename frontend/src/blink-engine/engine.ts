/** One call a frame: the lids at a moment. No dependencies, no allocation but the frame, bounded memory. */
import { type BlinkEvent, DEFAULT_PARAMETERS, type Parameters, type StateName } from "./parameters";
import { type Blink, BlinkPlan, endOf } from "./plan";
import { courseAt } from "./profile";

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

  /** Tell of an event, in the order of time; one in the past counts as happening at the last frame. */
  notify(event: BlinkEvent): void {
    this.plan.notify({ ...event, time_s: this.reach(event.time_s) });
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
