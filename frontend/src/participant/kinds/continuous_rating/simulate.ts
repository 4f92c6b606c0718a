/** A simulated participant: what is stored is like any other, with a playback of method none; what is done on the page, what people do. */
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../../trials/rating";
import { actWhileShown } from "../../trials/answers";
import type { TrialParameters } from "../../trials/trial";
import { continuousBody, type ContinuousData, declaredContinuous } from "./answer";
import { stepFrames } from "./track";

export async function simulatedTrace(session: Session, { trial, play }: TrialParameters): Promise<ContinuousData> {
  const { minimum, maximum, sample_hz } = declaredContinuous(session);
  const step_frames = stepFrames(trial.fps ?? 30, sample_hz);
  // The first frame has a sample, then every step after it.
  const length = Math.floor(((trial.frames ?? 1) - 1) / step_frames) + 1;
  // A slider that nobody moves stays in the middle.
  const values = Array.from({ length }, () => (minimum + maximum) / 2);
  const answer = { values, step_frames, moves: 0 };
  await saveRating(
    session,
    trial,
    continuousBody(session, trial, play, answer, playbackRecord(trial.clip_sha256, [], session.screen.record())),
  );
  return { samples: length, moves: 0, frames_missing: 0, again: play > 1 };
}

/** Presses whatever goes on; the slider stays where it is. */
export function actTrace(display: HTMLElement): void {
  actWhileShown(display, () => display.querySelector<HTMLButtonElement>(".primary")?.click());
}
