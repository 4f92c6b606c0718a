/** The trace of a simulated participant: the middle throughout, with a playback of method none. */
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { continuousBody } from "./body";
import { declaredContinuous } from "./declared";
import type { ContinuousData, ContinuousParameters } from "./screen";
import { stepFrames } from "./trace";

export async function simulatedTrace(session: Session, { trial, play }: ContinuousParameters): Promise<ContinuousData> {
  const { minimum, maximum, sample_hz } = declaredContinuous(session);
  const step_frames = stepFrames(trial.fps ?? 30, sample_hz);
  const length = Math.floor(((trial.frames ?? 1) - 1) / step_frames) + 1;
  const values = Array.from({ length }, () => (minimum + maximum) / 2);
  const answer = { values, step_frames, moves: 0 };
  await saveRating(
    session,
    trial,
    continuousBody(session, trial, play, answer, playbackRecord(trial.clip_sha256, [], session.screen.record())),
  );
  return { samples: length, moves: 0, frames_missing: 0, again: play > 1 };
}
