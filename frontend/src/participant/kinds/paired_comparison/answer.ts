/** The answers below a pair: their buttons, their keys and the declaration they belong to. */
import type { ShownPairedComparison } from "../../../api/schema";
import { type MessageKey, pick, type Translate } from "../../../i18n";
import { askAnswer } from "../../trials/answers";
import type { Arrangement } from "./layout";
import type { Session } from "../../session";

/** Which keys mean what below a pair. */
export type Winner = "left" | "right" | "tie";

/** Arrows point at a clip; 1 and 2 name it by its order; 3, 0 and T say that neither is chosen. */
const KEYS = new Map<string, Winner>(
  Object.entries({
    "1": "left",
    "2": "right",
    "3": "tie",
    ArrowLeft: "left",
    ArrowUp: "left",
    ArrowRight: "right",
    ArrowDown: "right",
    "0": "tie",
    t: "tie",
  }),
);

/** The answer a key stands for; null for other keys, and for a tie where none may be given. */
export function winnerOf(key: string, ties: boolean): Winner | null {
  // A letter counts with Shift or Caps Lock as well; names of other keys keep their capitals.
  const winner = KEYS.get(key.length === 1 ? key.toLowerCase() : key) ?? null;
  return winner === "tie" && !ties ? null : winner;
}

// The answers below a pair: a button each for the two clips, and one for a tie where it is declared.

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

/** What jsPsych's own data hold of a trial. */
export interface ComparisonData {
  winner: string | null;
  rt: number | null;
  again: boolean;
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

// The declaration of a run whose trials are paired comparisons.

export function declaredPairs({ run }: Session): ShownPairedComparison {
  if (run.trial.kind !== "paired_comparison") throw new Error(`expected a paired comparison, got ${run.trial.kind}`);
  return run.trial;
}
