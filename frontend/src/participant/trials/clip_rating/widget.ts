/** What a type of scale draws: a file of its name in ../scales, which exports `widget`. Found by the name. */
import type { ShownClipRating } from "../../../api/schema";
import type { Translate } from "../../../i18n";
import { loadModule } from "../../../ui/load-module";
import type { MeantPress } from "../../../ui/meant-press";

export type Scale = ShownClipRating["scales"][number];

export interface Ask {
  scale: Scale;
  /** The id of the question, which names the widget. */
  question: string;
  language: string;
  t: Translate;
  meant: MeantPress;
  choose: (value: number, time_stamp: number) => void;
  /** Enter was pressed where the page's own keys do not hear it. */
  enter: () => void;
}
export interface Widget {
  parts: HTMLElement[];
  /** False where an answer is moved to its place, and so counts only once it is confirmed. */
  settles: boolean;
  /** Show this answer as the one chosen; null takes it back. */
  show(value: number | null): void;
  /** A key pressed where this scale has the focus: the answer it stands for, if any. */
  pressed(key: string): number | null;
  focus?(): void;
}
type MakeWidget = (ask: Ask) => Widget;

const files = import.meta.glob<MakeWidget>("../scales/*.ts", { import: "widget" });
const makers = new Map<string, MakeWidget>();

/** Fetch what draws these scales. The kind asks for it before its first trial, so that no scale waits. */
export async function loadWidgets(scales: readonly Scale[]): Promise<void> {
  for (const { type } of scales) {
    if (makers.has(type)) continue;
    const load = files[`../scales/${type}.ts`];
    if (!load) throw new Error(`expected a scale this page knows, got ${type}; load the page again`);
    makers.set(type, await loadModule(load));
  }
}

/** The widget of a scale that `loadWidgets` has fetched. */
export function makeWidget(ask: Ask): Widget {
  const make = makers.get(ask.scale.type);
  if (!make) throw new Error(`expected the scale ${ask.scale.type} to be loaded`);
  return make(ask);
}
