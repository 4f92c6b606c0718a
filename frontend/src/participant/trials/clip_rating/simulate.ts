/** The rating of a simulated participant: stored like any other, with a playback of method none. */
import type { RatingBody } from "../rating";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { declaredRating } from "./declared";
import type { ClipRatingData, ClipRatingParameters } from "./screen";

export async function simulatedRating(session: Session, { trial, play }: ClipRatingParameters): Promise<ClipRatingData> {
  const { minimum, maximum } = declaredRating(session).scale;
  const response = minimum + Math.floor(Math.random() * (maximum - minimum + 1));
  const rt = 400 + Math.round(Math.random() * 1_200);
  const body: RatingBody = {
    trial_index: trial.trial_index,
    play,
    answer: { kind: "clip_rating", answers: { rating: { response } } },
    rt,
    rt_from_first_frame: rt + 1_500,
    time_elapsed: session.clock.elapsed(),
    changes: 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback: playbackRecord(trial.clip_sha256, [], session.screen.record()),
  };
  await saveRating(session, trial, body);
  return { response, rt, frames_missing: 0, key_to_first_frame_ms: null, again: play > 1 };
}
