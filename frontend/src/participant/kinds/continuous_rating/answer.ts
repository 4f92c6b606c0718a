/** What is sent of one play, and the declaration it belongs to. */
import type { TrialInfo, ShownContinuousRating } from "../../../api/schema";
import type { PlaybackRecord } from "../../playback/record";
import type { Session, RatingBody } from "../../session";
import { ratingBody } from "../../trials/rating";

// What is sent of one play.

type ContinuousAnswer = Extract<RatingBody["answer"], { kind: "continuous_rating" }>;

/** What jsPsych's own data hold of a trial. */
export interface ContinuousData {
  samples: number;
  moves: number;
  frames_missing: number | null;
  again: boolean;
}

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

// The declaration of a run whose clips are rated while they are shown.

export function declaredContinuous({ run }: Session): ShownContinuousRating {
  if (run.trial.kind !== "continuous_rating") throw new Error(`expected a continuous rating, got ${run.trial.kind}`);
  return run.trial;
}
