/** An instructed rating between trials: the same scale without a clip. Whether it was followed, the server knows. */
import type { TrialInfo } from "../../../api/schema";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { askScales, declaredRating, onlyResponse, type Rated } from "./answer";
import { ratingBody, saveRating } from "../../trials/rating";
import { askAttention } from "../../trials/answers";

export async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ response: number }> {
  const { check_scale, pointer_delay_ms, confirm } = declaredRating(session);
  // An instruction to press a number cannot be answered by "does not apply".
  const scales = [{ ...check_scale, not_applicable: null }];
  const { language, t } = session;
  const { answer, rt } = await askAttention(session, display, trial, (below, question, signal) =>
    askScales(below, { scales, pointer_delay_ms, confirm, comment: false, language, t, signal, question }),
  );
  await store(session, trial, answer, rt);
  return { response: onlyResponse(answer.answers) ?? check_scale.minimum };
}

export function store(session: Session, trial: TrialInfo, rated: Rated, rt: number): Promise<void> {
  // A check has no clip.
  const playback = playbackRecord(null, [], session.screen.record());
  const answer = { kind: "clip_rating", answers: rated.answers } as const;
  return saveRating(session, trial, ratingBody(session, trial, 1, answer, playback, { rt, changes: rated.changes }));
}
