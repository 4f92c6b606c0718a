/** A simulated participant: what is stored is like any other, with a playback of method none; what is done on the page, what people do. */
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../../trials/rating";
import { actWhileShown } from "../../trials/answers";
import type { TrialParameters } from "../../trials/trial";
import { thresholdBody, declaredThreshold, type ThresholdData } from "./answer";

export async function simulatedThreshold(session: Session, { trial, play }: TrialParameters): Promise<ThresholdData> {
  const { answers } = declaredThreshold(session);
  const chosen = answers[Math.random() < 0.5 ? 0 : 1].response;
  const rt = 300 + Math.round(Math.random() * 900);
  const playback = playbackRecord(trial.clip_sha256, [], session.screen.record());
  await saveRating(session, trial, thresholdBody(session, trial, play, chosen, playback, { rt, rt_from_first_frame: rt + 1_500 }));
  return { chosen, rt, again: play > 1 };
}

/** Presses start, then the second answer, then whatever goes on. */
export function actThreshold(display: HTMLElement): void {
  actWhileShown(display, () => {
    // The question may be on the page already; else start is what can be pressed.
    const press = [...display.querySelectorAll<HTMLButtonElement>(".pair-answer")].at(-1);
    (press ?? display.querySelector<HTMLButtonElement>(".primary"))?.click();
  });
}
