/** The screen of an instructed answer: the kind's own way of answering, without a clip. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { markdown } from "../../../ui/markdown";
import { focusHeading } from "../../../ui/page";
import { absoluteNow } from "../../playback/protocol";
import { screenSignal, stopButton } from "../../screens/support";
import type { Session } from "../../session";

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
