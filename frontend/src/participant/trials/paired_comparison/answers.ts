/** The answers below a pair: a button each for the two clips, and one for a tie where it is declared. */
import type { ShownPairedComparison } from "../../../api/schema";
import { type MessageKey, pick, type Translate } from "../../../i18n";
import { askAnswer } from "../shared/ask-answer";
import { winnerOf, type Winner } from "./answer-keys";
import type { Arrangement } from "./layout";

export interface Compared {
  winner: Winner;
  answered_at_ms: number;
}
export interface AnswerOptions {
  trial: ShownPairedComparison;
  arrangement: Arrangement;
  language: string;
  t: Translate;
  signal: AbortSignal;
  question: HTMLElement;
}

const LABELS: Record<Arrangement, [MessageKey, MessageKey]> = {
  side_by_side: ["pair_left", "pair_right"],
  stacked: ["pair_upper", "pair_lower"],
  one_after_the_other: ["pair_first", "pair_second"],
};

/** Show the answers in `container`; resolves with the one given. Its time is that of the press. */
export async function askWinner(container: HTMLElement, options: AnswerOptions): Promise<Compared> {
  const { trial, arrangement, language, t, signal, question } = options;
  const [one, other] = LABELS[arrangement];
  const { name, answered_at_ms } = await askAnswer<Winner>(container, {
    choices: [
      { name: "left", number: 1, label: t(one) },
      { name: "right", number: 2, label: t(other) },
    ],
    further: trial.tie ? [{ name: "tie", number: 3, label: pick(trial.tie, language) }] : [],
    keyed: (key) => winnerOf(key, trial.tie !== null),
    layout: arrangement,
    pointer_delay_ms: trial.pointer_delay_ms,
    signal,
    question,
  });
  return { winner: name, answered_at_ms };
}
