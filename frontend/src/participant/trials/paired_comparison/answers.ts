/** The answers below a pair: a button each for the two clips, and one for a tie where it is declared. */
import type { ShownPairedComparison } from "../../../api/schema";
import { type MessageKey, pick, type Translate } from "../../../i18n";
import { h, uniqueId } from "../../../ui/element";
import { listenKeys } from "../../../ui/keys";
import { MeantPress } from "../../../ui/meant-press";
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

const SEEN_MS = 140;
const LABELS: Record<Arrangement, [MessageKey, MessageKey]> = {
  side_by_side: ["pair_left", "pair_right"],
  stacked: ["pair_upper", "pair_lower"],
  one_after_the_other: ["pair_first", "pair_second"],
};
const NUMBERS: Record<Winner, number> = { left: 1, right: 2, tie: 3 };

/** Show the answers in `place`; resolves with the one given. Its time is that of the press. */
export function askWinner(place: HTMLElement, options: AnswerOptions): Promise<Compared> {
  const { trial, arrangement, language, t, signal, question } = options;
  const meant = new MeantPress(trial.pointer_delay_ms, signal);
  const [one, other] = LABELS[arrangement];
  return new Promise((resolve) => {
    let over = false;
    const buttons = new Map<Winner, HTMLButtonElement>();
    const choose = (winner: Winner, time_stamp: number): void => {
      if (over) return;
      over = true;
      buttons.get(winner)?.setAttribute("aria-pressed", "true");
      // Long enough to see the key go down; the time of the answer is already taken.
      setTimeout(() => resolve({ winner, answered_at_ms: performance.timeOrigin + time_stamp }), SEEN_MS);
    };
    const answer = (winner: Winner, label: string): HTMLButtonElement => {
      const onclick = (event: Event): void => {
        if (meant.allows(event)) choose(winner, event.timeStamp);
      };
      const key = h("span", { class: "number", "aria-hidden": "true" }, NUMBERS[winner]);
      const made = h(
        "button",
        { type: "button", class: "key pair-answer", "aria-pressed": "false", "data-winner": winner, onclick },
        key,
        label,
      );
      buttons.set(winner, made);
      return made;
    };
    const tie = trial.tie ? [answer("tie", pick(trial.tie, language))] : [];
    const sides = h("div", { class: "keys" }, answer("left", t(one)), answer("right", t(other)));
    question.id = uniqueId("question");
    const group = h(
      "div",
      { class: `scale pair-answers ${arrangement}`, role: "group", "aria-labelledby": question.id, tabindex: -1 },
      sides,
      ...tie,
    );
    place.replaceChildren(question, group);
    listenKeys((event) => {
      const winner = winnerOf(event.key, trial.tie !== null);
      if (!winner) return;
      event.preventDefault();
      choose(winner, event.timeStamp);
    }, signal);
    group.focus({ preventScroll: true });
  });
}
