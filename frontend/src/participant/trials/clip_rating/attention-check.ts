/** An instructed rating between trials: the same scale without a clip. Whether it was followed, the server knows. */
import type { TrialInfo } from "../../../api/schema";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { declaredRating } from "./declared";
import { onlyResponse } from "./answer";
import { askScales, type Rated } from "./scale";
import { saveRating } from "../save-rating";
import { askAttention } from "../shared/attention";

export async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ response: number }> {
  const { check_scale, pointer_delay_ms, confirm } = declaredRating(session);
  const scales = [{ ...check_scale, not_applicable: null }];
  const { language, t } = session;
  const { answer, rt } = await askAttention(session, display, trial, (below, question, signal) =>
    askScales(below, { scales, pointer_delay_ms, confirm, comment: false, language, t, signal, question }),
  );
  await store(session, trial, answer, rt);
  return { response: onlyResponse(answer.answers) ?? check_scale.minimum };
}

export function store(session: Session, trial: TrialInfo, rated: Rated, rt: number): Promise<void> {
  return saveRating(session, trial, {
    trial_index: trial.trial_index,
    play: 1,
    answer: { kind: "clip_rating", answers: rated.answers },
    rt,
    rt_from_first_frame: null,
    time_elapsed: session.clock.elapsed(),
    changes: rated.changes,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback: playbackRecord(null, [], session.screen.record()),
  });
}
