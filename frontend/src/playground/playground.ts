/** The blink engine live: every parameter under a slider, both characters at once, beside a uniform timer. */
import { BlinkEngine, DEFAULT_PARAMETERS, type EventKind, type Parameters, SOURCES, STATE_NAMES, type StateName } from "../blink-engine";
import { type Control, CONTROLS, valueAt, withValue } from "./controls";
import { curveCsv } from "./curve-file";
import { button, chooser, element, labelled, slider } from "./elements";
import { Face, type Strips } from "./faces";
import { Trace } from "./trace";
import { UniformTimer } from "./uniform-timer";

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

  /** Begin anew with what the sliders say: the same seed gives the same blinks. */
  private restart(): void {
    this.engine = new BlinkEngine({ seed: this.seed, state: this.state, parameters: this.parameters });
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
    const events = EVENTS.map(([kind, label]) =>
      button(label, () => this.engine.notify({ kind, time_s: 0, ...(kind === "gaze_shift" ? { amplitude_deg: 30 } : {}) })),
    );
    box.append(
      states,
      labelled("Seed", seed),
      ...events,
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
