/**
 * The only file that knows jsPsych. A screen is a function that resolves with its data; this makes it a plug-in.
 *
 * jsPsych races the promise of an async `trial` against finishTrial and takes an early return for the result, so
 * the plug-ins made here return nothing from `trial` and end by finishTrial alone.
 */
import { initJsPsych, ParameterType, type JsPsych } from "jspsych";

// Decision 0170: Screens are functions; one file knows jsPsych.
export const { INT, FLOAT, STRING, BOOL, OBJECT } = ParameterType;
export type SimulationMode = "visual" | "data-only";

export interface Screen<Parameters extends object, Data extends object> {
  name: string;
  /** What the timeline gives, and what the trial records, by type; a comment follows each. */
  parameters: { [Name in keyof Required<Parameters>]: ParameterType };
  data: { [Name in keyof Required<Data>]: ParameterType };
  show(display: HTMLElement, parameters: Parameters): Promise<Data>;
  /** What a participant would have done, without showing anything. */
  simulate(parameters: Parameters): Data | Promise<Data>;
  /** What a participant does, on the screen as it is shown. */
  act(display: HTMLElement, parameters: Parameters): Promise<void> | void;
}

const VERSION = "1.0.0";

/** As jsPsych wants its declarations. */
const declared = (types: Record<string, ParameterType>) =>
  Object.fromEntries(Object.entries(types).map(([name, type]) => [name, { type }]));

export interface PluginClass<Parameters> {
  new (jsPsych: JsPsych): object;
  readonly info: { name: string };
  /** Carries the type of the parameters; never set. */
  readonly takes?: Parameters;
}

export function plugin<Parameters extends object, Data extends object>(screen: Screen<Parameters, Data>): PluginClass<Parameters> {
  return class {
    static readonly info = { name: screen.name, version: VERSION, parameters: declared(screen.parameters), data: declared(screen.data) };
    constructor(private readonly jsPsych: JsPsych) {}

    trial(display: HTMLElement, trial: Parameters): void {
      // A failure reaches the page's own handler of unhandled rejections, which shows it to the participant.
      void screen.show(display, trial).then((data) => this.jsPsych.finishTrial(data));
    }

    simulate(trial: Parameters, mode: SimulationMode, _options: object, onLoad: () => void): void {
      onLoad();
      if (mode === "data-only") void Promise.resolve(screen.simulate(trial)).then((data) => this.jsPsych.finishTrial(data));
      else {
        const display = this.jsPsych.getDisplayElement();
        this.trial(display, trial);
        void Promise.resolve(screen.act(display, trial));
      }
    }
  };
}

/** What a simulated person does on a page: press these buttons from when it is there until it is gone. */
export function pressWhile(display: HTMLElement, page: string, buttons: string[]): void {
  let seen = false;
  const timer = setInterval(() => {
    const section = display.querySelector(page);
    if (seen && !section) clearInterval(timer);
    seen ||= section !== null;
    for (const name of buttons) section?.querySelector<HTMLButtonElement>(name)?.click();
  }, 250);
}

type OrFunction<Parameters> = { [Name in keyof Parameters]: Parameters[Name] | (() => Parameters[Name]) };
export type Node = { type: PluginClass<never> } | Branch;
interface Branch {
  timeline: Node[];
  conditional_function?: () => boolean;
  loop_function?: () => boolean;
  on_timeline_start?: () => void;
}

/** One trial of the timeline; parameters may be functions, which are asked when the trial begins. */
export function trial<Parameters extends object>(type: PluginClass<Parameters>, parameters: OrFunction<Parameters>): Node {
  return { type: type as PluginClass<never>, ...parameters };
}

export async function runTimeline(root: HTMLElement, timeline: Node[], simulation: SimulationMode | null): Promise<void> {
  const jsPsych = initJsPsych({ display_element: root, use_webaudio: false, default_iti: 0 });
  const nodes = timeline as unknown as Parameters<JsPsych["simulate"]>[0];
  if (simulation) await jsPsych.simulate(nodes, simulation);
  else await jsPsych.run(nodes as Parameters<JsPsych["run"]>[0]);
}
