/** An instructed answer between trials: seven numbers without a clip. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { markdown } from "../../../ui/markdown";
import { focusHeading } from "../../../ui/page";
import { absoluteNow } from "../../playback/protocol";
import { playbackRecord } from "../../playback/record";
import { screenSignal, stopButton } from "../../screens/support";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { askAnswer } from "../shared/ask-answer";
import "../shared/answers.css";
import { continuousBody } from "./body";
import { declaredContinuous } from "./declared";

export async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ chosen: number }> {
  const { signal, done } = screenSignal(session);
  const below = h("div", { class: "below" });
  const section = h("section", { class: "trial attention" }, h("div", { class: "above" }), below);
  section.append(stopButton(session));
  display.replaceChildren(section);
  const title = h("h1", { class: "eyebrow" }, session.t("attention_title"));
  const question = h("div", { class: "question" }, title, ...markdown(trial.prompt ?? ""));
  const shown_at_ms = absoluteNow();
  const { check_scale, pointer_delay_ms } = declaredContinuous(session);
  const numbers = Array.from({ length: check_scale.maximum }, (_, place) => String(place + 1));
  const answer = askAnswer(below, {
    choices: numbers.map((name) => ({ name, number: Number(name), label: "" })),
    keyed: (key) => (numbers.includes(key) ? key : null),
    layout: "side_by_side",
    pointer_delay_ms,
    signal,
    question,
  });
  focusHeading(section);
  const { name, answered_at_ms } = await answer;
  done();
  const chosen = Number(name);
  await store(session, trial, chosen, Math.round((answered_at_ms - shown_at_ms) * 100) / 100);
  return { chosen };
}

export function store(session: Session, trial: TrialInfo, chosen: number, rt: number): Promise<void> {
  return saveRating(session, trial, continuousBody(session, trial, 1, { chosen }, playbackRecord(null, [], session.screen.record()), rt));
}
