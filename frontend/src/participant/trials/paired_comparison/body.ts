/** From what was shown of a pair to what the server is sent. */
import type { TrialInfo } from "../../../api/schema";
import type { PlaybackRecord } from "../../playback/record";
import type { RatingBody } from "../rating";
import type { Winner } from "./answer-keys";
import type { Arrangement } from "./layout";

export interface Given {
  winner: Winner | null;
  arrangement: Arrangement | null;
  rt: number | null;
  rt_from_first_frame: number | null;
  time_elapsed: number;
}

export function comparisonBody(trial: TrialInfo, play: number, given: Given, playback: PlaybackRecord): RatingBody {
  return {
    trial_index: trial.trial_index,
    play,
    answer: { kind: "paired_comparison", winner: given.winner, arrangement: given.arrangement },
    rt: given.rt,
    rt_from_first_frame: given.rt_from_first_frame,
    time_elapsed: given.time_elapsed,
    changes: 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback,
  };
}
