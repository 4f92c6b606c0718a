/** The blink engine live: a slider for every parameter, both characters at once, next to a uniform timer. */
import {
  DEFAULT_PARAMETERS,
  type Parameters,
  STATE_NAMES,
  BlinkEngine,
  type EngineOptions,
  type EventKind,
  SOURCES,
  type StateName,
} from "../blink-engine";
import { Face, type Strips } from "./faces";

// One control for each number the engine draws by.

interface Control {
  /** The path of the number in `Parameters`, such as `profile.closing_s.median`. */
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

/** The same with one number changed; everything off the path is shared. */
export function withValue(parameters: Parameters, path: string, value: number): Parameters {
  const changed = (tree: object, [key = "", ...rest]: readonly string[]): object => ({
    ...tree,
    [key]: rest.length === 0 ? value : changed((tree as Record<string, object>)[key] ?? {}, rest),
  });
  return changed(parameters, path.split(".")) as Parameters;
}

// A performance of the playground as a file, in the columns of `stimuli performance --format csv`.

const LOWER_UP_MM = 0.75;
const LOWER_IN_MM = 2.6;

/** Seconds and frames per second of what is saved. */
export interface Length {
  seconds: number;
  fps: number;
}

export function curveCsv(options: EngineOptions, { seconds, fps }: Length): string {
  const engine = new BlinkEngine(options);
  const rows = Array.from({ length: Math.round(seconds * fps) }, (_, frame) => {
    const lids = engine.frame(frame / fps);
    const up = (LOWER_UP_MM * (lids.left_lower_up + lids.right_lower_up)) / 2;
    const nasal = (LOWER_IN_MM * (lids.left_lower_in + lids.right_lower_in)) / 2;
    return [
      frame,
      (frame / fps).toFixed(6),
      ...[lids.left, lids.right, up, nasal].map((value) => String(Math.round(value * 1e6) / 1e6)),
    ].join();
  });
  return ["frame,time_s,closure_left,closure_right,lower_up_mm,lower_nasal_mm", ...rows, ""].join("\n");
}

// The few elements that the playground is made of.

interface RangeOptions {
  min: number;
  max: number;
  step: number;
}

function element<Name extends keyof HTMLElementTagNameMap>(name: Name, className: string, text = ""): HTMLElementTagNameMap[Name] {
  const made = document.createElement(name);
  if (className !== "") made.className = className;
  made.textContent = text;
  return made;
}

function button(label: string, press: () => void): HTMLButtonElement {
  const made = element("button", "", label);
  made.type = "button";
  made.addEventListener("click", press);
  return made;
}

/** A control with its name before it. */
function labelled(name: string, control: HTMLElement): HTMLLabelElement {
  const label = element("label", "playground-labelled");
  label.append(element("span", "", name), control);
  return label;
}

function chooser<Choice extends string>(name: string, choices: readonly Choice[], take: (choice: Choice) => void): HTMLElement {
  const select = element("select", "");
  select.append(...choices.map((choice) => new Option(choice, choice)));
  select.addEventListener("change", () => {
    const chosen = choices[select.selectedIndex];
    if (chosen !== undefined) take(chosen);
  });
  return labelled(name, select);
}

/** A slider with its value next to it, and a way to set it from outside. */
function slider(
  name: string,
  { min, max, step }: RangeOptions,
  value: number,
  take: (value: number) => void,
): { row: HTMLElement; set: (value: number) => void } {
  const input = element("input", "");
  const output = element("output", "");
  Object.assign(input, { type: "range", min: String(min), max: String(max), step: String(step) });
  const set = (now: number): void => {
    input.value = String(now);
    output.textContent = String(Math.round(now * 1000) / 1000);
  };
  set(value);
  input.addEventListener("input", () => {
    output.textContent = input.value;
    take(input.valueAsNumber);
  });
  const row = labelled(name, input);
  row.append(output);
  return { row, set };
}

// The closure of the last seconds, drawn as a moving line.

const SECONDS = 8;

class Trace {
  readonly canvas = document.createElement("canvas");
  private readonly points: [time_s: number, closure: number][] = [];

  constructor(name: string) {
    this.canvas.width = 480;
    this.canvas.height = 60;
    this.canvas.className = "playground-trace";
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `Closure over the last ${SECONDS} seconds: ${name}`);
  }

  add(time_s: number, closure: number): void {
    this.points.push([time_s, closure]);
    while ((this.points[0]?.[0] ?? time_s) < time_s - SECONDS) this.points.shift();
    const drawing = this.canvas.getContext("2d");
    if (drawing === null) return;
    const { width, height } = this.canvas;
    drawing.clearRect(0, 0, width, height);
    drawing.strokeStyle = getComputedStyle(this.canvas).color;
    drawing.lineWidth = 2;
    drawing.beginPath();
    for (const [at, value] of this.points) drawing.lineTo(width - ((time_s - at) / SECONDS) * width, 2 + value * (height - 4));
    drawing.stroke();
  }

  clear(): void {
    this.points.length = 0;
  }
}

// What most programs do today: one fixed blink after another, evenly spread waits between.

const CLOSING_S = 0.1;
const CLOSED_S = 0.05;
const OPENING_S = 0.15;
const MIN_WAIT_S = 2;
const MAX_WAIT_S = 6;

export class UniformTimer {
  private onset_s: number;
  private readonly random: () => number;

  constructor(random: () => number = Math.random) {
    this.random = random;
    this.onset_s = this.wait();
  }

  /** Closure of both eyes at a moment that must not run backwards. */
  closure(time_s: number): number {
    while (time_s > this.onset_s + CLOSING_S + CLOSED_S + OPENING_S) this.onset_s += this.wait();
    const since = time_s - this.onset_s;
    if (since <= 0) return 0;
    if (since < CLOSING_S) return since / CLOSING_S;
    return Math.max(0, Math.min(1, 1 - (since - CLOSING_S - CLOSED_S) / OPENING_S));
  }

  private wait(): number {
    return MIN_WAIT_S + (MAX_WAIT_S - MIN_WAIT_S) * this.random();
  }
}

export interface Given {
  strips: Strips;
  /** Where the strip of a character is. */
  address: (character: string) => string;
}

const EVENTS: readonly [EventKind, string][] = [
  ["blink", "Blink"],
  ["utterance_start", "Utterance starts"],
  ["pause", "Pause"],
  ["utterance_end", "Utterance ends"],
  ["turn_end", "Turn ends"],
  ["gaze_shift", "Gaze shift, 30°"],
];
const SAVED = { seconds: 60, fps: 60 };

class Playground {
  private parameters: Parameters = DEFAULT_PARAMETERS;
  private state: StateName = "rest";
  private seed = 1;
  private gaze_deg = 0;
  private squint = 0;
  private held = false;
  private engine = new BlinkEngine({ seed: 1 });
  private timer = new UniformTimer();
  private began_ms: number | null = null;
  private readonly sides: readonly { faces: Face[]; trace: Trace }[];
  private readonly sliders = new Map<string, (value: number) => void>();

  constructor(root: HTMLElement, given: Given) {
    this.sides = ["Blink engine", "Uniform timer, every 2 to 6 s"].map((name) => ({
      faces: given.strips.characters.map((character) => new Face(given.strips, character, given.address(character))),
      trace: new Trace(name),
    }));
    const stage = element("div", "playground-stage");
    this.sides.forEach(({ faces, trace }, side) => {
      const heading = element("h2", "", side === 0 ? "Blink engine" : "Uniform timer");
      const column = element("section", "playground-side");
      column.append(heading, ...faces.map((face) => face.canvas), trace.canvas);
      stage.append(column);
    });
    root.append(stage, this.actions(), this.groups());
  }

  /** Draw the moment of an animation frame. */
  show(now_ms: number): void {
    this.began_ms ??= now_ms;
    const time_s = (now_ms - this.began_ms) / 1000;
    const lids = this.engine.frame(time_s, this.gaze_deg, this.squint);
    const uniform = this.timer.closure(time_s);
    const shown: readonly [number, number][] = [
      [lids.left, lids.right],
      [uniform, uniform],
    ];
    this.sides.forEach(({ faces, trace }, side) => {
      const [left, right] = shown[side] ?? [0, 0];
      for (const face of faces) face.show(left, right);
      trace.add(time_s, left);
    });
  }

  /** Start over with the values of the sliders: the same seed gives the same blinks. */
  private restart(): void {
    this.engine = new BlinkEngine({ seed: this.seed, state: this.state, parameters: this.parameters });
    this.engine.holdBlinks(this.held);
    this.timer = new UniformTimer();
    this.began_ms = null;
    for (const { trace } of this.sides) trace.clear();
  }

  private actions(): HTMLElement {
    const box = element("div", "playground-actions");
    const states = chooser("State", STATE_NAMES, (state) => {
      this.state = state;
      this.engine.setState(state);
    });
    const seed = element("input", "");
    seed.type = "number";
    seed.min = "0";
    seed.value = String(this.seed);
    seed.addEventListener("change", () => {
      this.seed = Math.max(0, Math.trunc(seed.valueAsNumber) || 0);
      this.restart();
    });
    const held = element("input", "");
    held.type = "checkbox";
    held.addEventListener("change", () => {
      this.held = held.checked;
      this.engine.holdBlinks(this.held);
    });
    const events = EVENTS.map(([kind, label]) =>
      button(label, () => this.engine.notify({ kind, time_s: 0, ...(kind === "gaze_shift" ? { amplitude_deg: 30 } : {}) })),
    );
    box.append(
      states,
      labelled("Seed", seed),
      ...events,
      labelled("Eyes stay open (flag)", held),
      button("Start again", () => this.restart()),
      button("Defaults", () => this.reset()),
      button("Save 60 s as CSV", () => this.save()),
    );
    return box;
  }

  private groups(): HTMLElement {
    const box = element("div", "playground-groups");
    const now = element("details", "");
    now.open = true;
    now.append(
      element("summary", "", "Now"),
      slider("gaze below the horizon (°)", { min: -30, max: 40, step: 1 }, 0, (value) => (this.gaze_deg = value)).row,
      slider("squint", { min: 0, max: 1, step: 0.01 }, 0, (value) => (this.squint = value)).row,
    );
    box.append(now, ...[...new Set(CONTROLS.map(({ group }) => group))].map((group) => this.group(group)));
    return box;
  }

  private group(name: string): HTMLElement {
    const box = element("details", "");
    box.append(element("summary", "", name));
    for (const control of CONTROLS.filter(({ group }) => group === name)) box.append(this.control(control));
    const source = Object.entries(SOURCES).filter(([key]) => CONTROLS.some(({ group, path }) => group === name && path.includes(key)));
    if (source.length > 0) {
      const list = element("ul", "playground-source");
      list.append(...source.map(([key, text]) => element("li", "", `${key.replaceAll("_", " ")}: ${text}`)));
      box.append(list);
    }
    return box;
  }

  private control(control: Control): HTMLElement {
    const made = slider(control.label, control, valueAt(this.parameters, control.path), (value) => {
      this.parameters = withValue(this.parameters, control.path, value);
      this.restart();
    });
    this.sliders.set(control.path, made.set);
    return made.row;
  }

  private reset(): void {
    this.parameters = DEFAULT_PARAMETERS;
    for (const [path, set] of this.sliders) set(valueAt(DEFAULT_PARAMETERS, path));
    this.restart();
  }

  private save(): void {
    const text = curveCsv({ seed: this.seed, state: this.state, parameters: this.parameters }, SAVED);
    const link = element("a", "");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = `blinks-seed-${this.seed}.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
  }
}

/** Put the playground into an element; returns what stops and removes it. */
export function mountPlayground(root: HTMLElement, given: Given): () => void {
  const playground = new Playground(root, given);
  let handle = 0;
  const tick = (now_ms: number): void => {
    playground.show(now_ms);
    handle = requestAnimationFrame(tick);
  };
  handle = requestAnimationFrame(tick);
  return () => {
    cancelAnimationFrame(handle);
    root.replaceChildren();
  };
}
