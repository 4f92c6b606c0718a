/** What the server is sent of one motion check. */
import type { CheckAnswer, TrialInfo } from "../../../api/schema";
import { playbackRecord, type PlaybackRecord } from "../../playback/record";
import type { Session } from "../../session";
import type { RatingBody } from "../rating";

interface Times {
  rt: number | null;
  rt_from_first_frame: number | null;
}

const NO_TIMES: Times = { rt: null, rt_from_first_frame: null };

export function checkBody(
  session: Session,
  trial: TrialInfo,
  answer: Pick<CheckAnswer, "check" | "other_way">,
  playback: PlaybackRecord,
  times = NO_TIMES,
  play = 1,
): RatingBody {
  return {
    trial_index: trial.trial_index,
    play,
    answer: { kind: "check", ...answer },
    ...times,
    time_elapsed: session.clock.elapsed(),
    changes: 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback,
  };
}

/** What is stored of a check that nobody could answer: its clip could not be shown, or its view was broken off. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = playbackRecord(null, [], session.screen.record());
  return checkBody(session, trial, { check: null, other_way: false }, playback, NO_TIMES, play);
}
