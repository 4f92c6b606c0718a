/** What a type of scale draws: a file of its name in ../scales, which exports `widget`. Found by the name. */
import type { ShownClipRating } from "../../../api/schema";
import type { Translate } from "../../../i18n";
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

const files = import.meta.glob<MakeWidget>("../scales/*.ts", { import: "widget", eager: true });

export function makeWidget(ask: Ask): Widget {
  const make = files[`../scales/${ask.scale.type}.ts`];
  if (!make) throw new Error(`expected a scale this page knows, got ${ask.scale.type}; load the page again`);
  return make(ask);
}
