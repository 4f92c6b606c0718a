/** What is sent of one play. */
import type { TrialInfo } from "../../../api/schema";
import type { PlaybackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { ratingBody, type RatingBody } from "../rating";

type ContinuousAnswer = Extract<RatingBody["answer"], { kind: "continuous_rating" }>;

export function continuousBody(
  session: Session,
  trial: TrialInfo,
  play: number,
  answer: Partial<ContinuousAnswer>,
  playback: PlaybackRecord,
  rt: number | null = null,
): RatingBody {
  return ratingBody(session, trial, play, { kind: "continuous_rating", ...answer }, playback, { rt, changes: answer.moves ?? 0 });
}
