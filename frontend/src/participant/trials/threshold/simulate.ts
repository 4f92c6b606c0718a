/** The answer of a simulated participant: stored like any other, with a playback of method none. */
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { thresholdBody } from "./body";
import { declaredThreshold } from "./declared";
import type { ThresholdData, ThresholdParameters } from "./screen";

export async function simulatedThreshold(session: Session, { trial, play }: ThresholdParameters): Promise<ThresholdData> {
  const { answers } = declaredThreshold(session);
  const chosen = answers[Math.random() < 0.5 ? 0 : 1].response;
  const rt = 300 + Math.round(Math.random() * 900);
  const given = { chosen, rt, rt_from_first_frame: rt + 1_500, time_elapsed: session.clock.elapsed() };
  const playback = playbackRecord(trial.clip_sha256, [], session.screen.record());
  await saveRating(session, trial, thresholdBody(trial, play, given, playback));
  return { chosen, rt, again: play > 1 };
}
