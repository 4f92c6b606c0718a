/** What the server is sent of one trial of a series. */
import type { TrialInfo } from "../../../api/schema";
import type { PlaybackRecord } from "../../playback/record";
import type { RatingBody } from "../rating";
import type { Response } from "./answers";

export interface Given {
  chosen: Response | null;
  rt: number | null;
  rt_from_first_frame: number | null;
  time_elapsed: number;
}

export function thresholdBody(trial: TrialInfo, play: number, given: Given, playback: PlaybackRecord): RatingBody {
  return {
    trial_index: trial.trial_index,
    play,
    answer: { kind: "threshold", chosen: given.chosen, known: trial.series?.known ?? 0 },
    rt: given.rt,
    rt_from_first_frame: given.rt_from_first_frame,
    time_elapsed: given.time_elapsed,
    changes: 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback,
  };
}
