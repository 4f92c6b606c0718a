/** An instructed rating between trials: the same scale without a clip. Whether it was followed, the server knows. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { markdown } from "../../../ui/markdown";
import { focusHeading } from "../../../ui/page";
import { playbackRecord } from "../../playback/record";
import { absoluteNow } from "../../playback/protocol";
import { screenSignal, stopButton } from "../../screens/support";
import type { Session } from "../../session";
import { declaredRating } from "./declared";
import { onlyResponse } from "./answer";
import { askScales, type Rated } from "./scale";
import { saveRating } from "../save-rating";

export async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ response: number }> {
  const { signal, done } = screenSignal(session);
  const below = h("div", { class: "below" });
  const section = h("section", { class: "trial attention" }, h("div", { class: "above" }), below);
  section.append(stopButton(session));
  display.replaceChildren(section);
  const question = h(
    "div",
    { class: "question" },
    h("h1", { class: "eyebrow" }, session.t("attention_title")),
    ...markdown(trial.prompt ?? ""),
  );
  const shown_at_ms = absoluteNow();
  const { check_scale, pointer_delay_ms, confirm } = declaredRating(session);
  const scales = [{ ...check_scale, not_applicable: null }];
  const { language, t } = session;
  const answer = askScales(below, { scales, pointer_delay_ms, confirm, comment: false, language, t, signal, question });
  focusHeading(section);
  const rated = await answer;
  done();
  await store(session, trial, shown_at_ms, rated);
  return { response: onlyResponse(rated.answers) ?? check_scale.minimum };
}

export function store(session: Session, trial: TrialInfo, shown_at_ms: number, rated: Rated): Promise<void> {
  return saveRating(session, trial, {
    trial_index: trial.trial_index,
    play: 1,
    answer: { kind: "clip_rating", answers: rated.answers },
    rt: Math.round((rated.answered_at_ms - shown_at_ms) * 100) / 100,
    rt_from_first_frame: null,
    time_elapsed: session.clock.elapsed(),
    changes: rated.changes,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback: playbackRecord(null, [], session.screen.record()),
  });
}
