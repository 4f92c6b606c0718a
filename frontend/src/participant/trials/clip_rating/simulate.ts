/** The rating of a simulated participant: stored like any other, with a playback of method none. */
import type { RatingBody } from "../rating";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { declaredRating } from "./declared";
import { onlyResponse } from "./answer";
import type { ClipRatingData, ClipRatingParameters } from "./screen";
import type { Scale } from "./widget";

export async function simulatedRating(session: Session, { trial, play }: ClipRatingParameters): Promise<ClipRatingData> {
  const { scales } = declaredRating(session);
  const answers = Object.fromEntries(scales.map((scale) => [scale.name, { response: anyOf(scale) }]));
  const rt = 400 + Math.round(Math.random() * 1_200);
  const body: RatingBody = {
    trial_index: trial.trial_index,
    play,
    answer: { kind: "clip_rating", answers },
    rt,
    rt_from_first_frame: rt + 1_500,
    time_elapsed: session.clock.elapsed(),
    changes: 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback: playbackRecord(trial.clip_sha256, [], session.screen.record()),
  };
  await saveRating(session, trial, body);
  return { response: onlyResponse(answers), rt, frames_missing: 0, key_to_first_frame_ms: null, again: play > 1 };
}

function anyOf(scale: Scale): number {
  const step = scale.type === "slider" ? scale.step : 1;
  const steps = Math.round((scale.maximum - scale.minimum) / step);
  return Number((scale.minimum + step * Math.floor(Math.random() * (steps + 1))).toFixed(6));
}
