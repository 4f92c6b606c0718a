/** The answers below a clip as buttons, chosen by press or key; in a trial, in an instructed answer, by a simulation. */
import { h, uniqueId, focusHeading } from "../../ui/element";
import { keyOf, listenKeys, MeantPress } from "../../ui/keys";
import type { TrialInfo } from "../../api/schema";
import { markdown } from "../../ui/markdown";
import { absoluteNow } from "../playback/protocol";
import { screenSignal, stopButton } from "../screens/support";
import type { Session } from "../session";

// The answers below a clip as buttons, each with its number, chosen by press or key.

interface Choice<Name extends string> {
  name: Name;
  number: number;
  label: string;
}
export interface AskOptions<Name extends string> {
  /** Next to one another, and those below them. */
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
      // Within the time in which the key is seen to go down, a second press must not answer as well.
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
      // A letter answers with Caps Lock on, too; keys with a longer name keep it as it is.
      const name = keyed(key.length === 1 ? key.toLowerCase() : key);
      if (!name) return;
      event.preventDefault();
      choose(name, event.timeStamp);
    }, signal);
    group.focus({ preventScroll: true });
  });
}

// The screen of an instructed answer: the kind's own way of answering, without a clip.

type Ask<Answer> = (below: HTMLElement, question: HTMLElement, signal: AbortSignal) => Promise<Answer>;

/** The answer that `ask` got below the question, and its response time in ms. */
export async function askAttention<Answer extends { answered_at_ms: number }>(
  session: Session,
  display: HTMLElement,
  trial: TrialInfo,
  ask: Ask<Answer>,
): Promise<{ answer: Answer; rt: number }> {
  const { signal, done } = screenSignal(session);
  const below = h("div", { class: "below" });
  const section = h("section", { class: "trial attention" }, h("div", { class: "above" }), below);
  section.append(stopButton(session));
  display.replaceChildren(section);
  const title = h("h1", { class: "eyebrow" }, session.t("attention_title"));
  const question = h("div", { class: "question" }, title, ...markdown(trial.prompt ?? ""));
  const shown_at_ms = absoluteNow();
  const asked = ask(below, question, signal);
  focusHeading(section);
  const answer = await asked;
  done();
  return { answer, rt: Math.round((answer.answered_at_ms - shown_at_ms) * 100) / 100 };
}

/** What a simulated person does on a trial's page: from when it is there, again and again until it is gone. */
export function actWhileShown(display: HTMLElement, act: () => void): void {
  let own: Element | null = null;
  const timer = setInterval(() => {
    // A trial may wait before its page is shown, as for the server's choice of a stimulus.
    own ??= display.querySelector(".trial");
    if (own?.isConnected) act();
    else if (own) clearInterval(timer);
  }, 250);
}
