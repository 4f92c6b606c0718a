/** A simulated participant: what is stored is like any other, with a playback of method none; what is done on the page, what people do. */
import { ratingBody, saveRating } from "../../trials/rating";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { actWhileShown } from "../../trials/answers";
import type { TrialParameters } from "../../trials/trial";
import { declaredRating, type ClipRatingData, onlyResponse, type Scale } from "./answer";

export async function simulatedRating(session: Session, { trial, play }: TrialParameters): Promise<ClipRatingData> {
  const { scales, reference } = declaredRating(session);
  const answers = Object.fromEntries(scales.map((scale) => [scale.name, { response: anyOf(scale) }]));
  const rt = 400 + Math.round(Math.random() * 1_200);
  const playback = playbackRecord(trial.clip_sha256, [], session.screen.record());
  const answer = { kind: "clip_rating", answers, ...(reference && { reference_gap_ms: reference.gap_ms }) } as const;
  const body = ratingBody(session, trial, play, answer, playback, { rt, rt_from_first_frame: rt + 1_500 });
  await saveRating(session, trial, body);
  return { response: onlyResponse(answers), rt, frames_missing: 0, key_to_first_frame_ms: null, again: play > 1 };
}

function anyOf(scale: Scale): number {
  const step = scale.type === "slider" ? scale.step : 1;
  const steps = Math.round((scale.maximum - scale.minimum) / step);
  // Rounded, since steps such as 0.1 do not add up exactly.
  return Number((scale.minimum + step * Math.floor(Math.random() * (steps + 1))).toFixed(6));
}

/** Presses start, then a middle key, then whatever goes on. */
export function actRating(display: HTMLElement): void {
  actWhileShown(display, () => {
    for (const row of display.querySelectorAll(".keys")) {
      const keys = [...row.querySelectorAll<HTMLButtonElement>(".key")];
      keys[Math.floor(keys.length / 2)]?.click();
    }
    for (const slider of display.querySelectorAll<HTMLInputElement>(".slider")) slider.click();
    display.querySelector<HTMLButtonElement>(".primary")?.click();
  });
}
