/** What the server is sent of one trial of a series. */
import type { TrialInfo } from "../../../api/schema";
import type { PlaybackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { ratingBody, type RatingBody } from "../rating";
import type { Response } from "./answers";

type Times = Partial<Pick<RatingBody, "rt" | "rt_from_first_frame">>;

export function thresholdBody(
  session: Session,
  trial: TrialInfo,
  play: number,
  chosen: Response | null,
  playback: PlaybackRecord,
  times: Times = {},
): RatingBody {
  const answer = { kind: "threshold", chosen, known: trial.series?.known ?? 0 } as const;
  return ratingBody(session, trial, play, answer, playback, times);
}
