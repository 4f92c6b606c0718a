/** The answers below a clip as buttons, each with its number, chosen by press or key. */
import { h, uniqueId } from "../../../ui/element";
import { keyOf, listenKeys } from "../../../ui/keys";
import { MeantPress } from "../../../ui/meant-press";

interface Choice<Name extends string> {
  name: Name;
  number: number;
  label: string;
}
export interface AskOptions<Name extends string> {
  /** Beside one another, and those below them. */
  choices: Choice<Name>[];
  further?: Choice<Name>[];
  /** The answer that a key stands for. */
  keyed: (key: string) => Name | null;
  layout: string;
  pointer_delay_ms: number;
  signal: AbortSignal;
  question: HTMLElement;
}
export interface Chosen<Name extends string> {
  name: Name;
  answered_at_ms: number;
}

const SEEN_MS = 140;

/** Show the answers in `container`; resolves with the one given. Its time is that of the press. */
export function askAnswer<Name extends string>(container: HTMLElement, options: AskOptions<Name>): Promise<Chosen<Name>> {
  const { choices, further = [], keyed, layout, signal, question } = options;
  const meant = new MeantPress(options.pointer_delay_ms, signal);
  return new Promise((resolve) => {
    let over = false;
    const buttons = new Map<Name, HTMLButtonElement>();
    const choose = (name: Name, time_stamp: number): void => {
      if (over) return;
      over = true;
      buttons.get(name)?.setAttribute("aria-pressed", "true");
      // Long enough to see the key go down; the time of the answer is already taken.
      setTimeout(() => resolve({ name, answered_at_ms: performance.timeOrigin + time_stamp }), SEEN_MS);
    };
    const answer = ({ name, number, label }: Choice<Name>): HTMLButtonElement => {
      const onclick = (event: Event): void => {
        if (meant.allows(event)) choose(name, event.timeStamp);
      };
      const key = h("span", { class: "number", "aria-hidden": "true" }, number);
      const attributes = { type: "button", class: "key pair-answer", "aria-pressed": "false", "data-answer": name, onclick } as const;
      const made = h("button", attributes, key, label);
      buttons.set(name, made);
      return made;
    };
    question.id = uniqueId("question");
    const group = h(
      "div",
      { class: `scale pair-answers ${layout}`, role: "group", "aria-labelledby": question.id, tabindex: -1 },
      h("div", { class: "keys" }, ...choices.map(answer)),
      ...further.map(answer),
    );
    container.replaceChildren(question, group);
    listenKeys((event) => {
      const key = keyOf(event);
      const name = keyed(key.length === 1 ? key.toLowerCase() : key);
      if (!name) return;
      event.preventDefault();
      choose(name, event.timeStamp);
    }, signal);
    group.focus({ preventScroll: true });
  });
}
