/** The answer of a simulated participant: stored like any other, with a playback of method none. */
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import type { Winner } from "./answer-keys";
import { comparisonBody } from "./body";
import { declaredPairs } from "./declared";
import type { ComparisonData, ComparisonParameters } from "./screen";

export async function simulatedComparison(session: Session, { trial, play }: ComparisonParameters): Promise<ComparisonData> {
  const declared = declaredPairs(session);
  const choices: Winner[] = declared.tie ? ["left", "right", "tie"] : ["left", "right"];
  const winner = choices[Math.floor(Math.random() * choices.length)] ?? "left";
  const rt = 400 + Math.round(Math.random() * 1_200);
  const { arrangement } = declared.presentation;
  const given = { winner, arrangement, rt, rt_from_first_frame: rt + 1_500, time_elapsed: session.clock.elapsed() };
  const first = trial.clips[0]?.clip_sha256 ?? null;
  await saveRating(session, trial, comparisonBody(trial, play, given, playbackRecord(first, [], session.screen.record())));
  return { winner, rt, again: play > 1 };
}
