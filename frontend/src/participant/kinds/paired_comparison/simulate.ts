/** A simulated participant: what is stored is like any other, with a playback of method none; what is done on the page, what people do. */
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { ratingBody, saveRating } from "../../trials/rating";
import { actWhileShown } from "../../trials/answers";
import type { TrialParameters } from "../../trials/trial";
import { type Winner, declaredPairs, type ComparisonData } from "./answer";

export async function simulatedComparison(session: Session, { trial, play }: TrialParameters): Promise<ComparisonData> {
  const declared = declaredPairs(session);
  const choices: Winner[] = declared.tie ? ["left", "right", "tie"] : ["left", "right"];
  const winner = choices[Math.floor(Math.random() * choices.length)] ?? "left";
  const rt = 400 + Math.round(Math.random() * 1_200);
  const { arrangement } = declared.presentation;
  const answer = { kind: "paired_comparison", winner, arrangement } as const;
  const first = trial.clips[0]?.clip_sha256 ?? null;
  const playback = playbackRecord(first, [], session.screen.record());
  await saveRating(session, trial, ratingBody(session, trial, play, answer, playback, { rt, rt_from_first_frame: rt + 1_500 }));
  return { winner, rt, again: play > 1 };
}

/** Presses start, then the second clip, then whatever goes on. */
export function actComparison(display: HTMLElement): void {
  actWhileShown(display, () => {
    // The answers appear only after both clips; until then start is what can be pressed.
    const press =
      display.querySelector<HTMLButtonElement>(".pair-answer[data-answer=right]") ?? display.querySelector<HTMLButtonElement>(".primary");
    press?.click();
  });
}
