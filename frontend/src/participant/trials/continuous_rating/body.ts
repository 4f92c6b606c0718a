/** What is sent of one play. */
import type { TrialInfo } from "../../../api/schema";
import type { PlaybackRecord } from "../../playback/record";
import type { Session } from "../../session";
import type { RatingBody } from "../rating";

type ContinuousAnswer = Extract<RatingBody["answer"], { kind: "continuous_rating" }>;

export function continuousBody(
  session: Session,
  trial: TrialInfo,
  play: number,
  answer: Partial<ContinuousAnswer>,
  playback: PlaybackRecord,
  rt: number | null = null,
): RatingBody {
  return {
    trial_index: trial.trial_index,
    play,
    answer: { kind: "continuous_rating", ...answer },
    rt,
    rt_from_first_frame: null,
    time_elapsed: session.clock.elapsed(),
    changes: answer.moves ?? 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback,
  };
}
