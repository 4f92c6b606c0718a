/** What the server is sent of one motion check. */
import type { CheckAnswer, TrialInfo } from "../../../api/schema";
import { playbackRecord, type PlaybackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { ratingBody, type RatingBody } from "../rating";

type Times = Partial<Pick<RatingBody, "rt" | "rt_from_first_frame">>;

export function checkBody(
  session: Session,
  trial: TrialInfo,
  answer: Pick<CheckAnswer, "check" | "other_way">,
  playback: PlaybackRecord,
  times: Times = {},
  play = 1,
): RatingBody {
  return ratingBody(session, trial, play, { kind: "check", ...answer }, playback, times);
}

/** What is stored of a check that nobody could answer: its clip could not be shown, or its view was broken off. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = playbackRecord(null, [], session.screen.record());
  return checkBody(session, trial, { check: null, other_way: false }, playback, {}, play);
}
