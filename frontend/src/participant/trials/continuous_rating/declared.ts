/** The declaration of a run whose clips are rated while they are shown. */
import type { ShownContinuousRating } from "../../../api/schema";
import type { Session } from "../../session";

export function declaredContinuous({ run }: Session): ShownContinuousRating {
  if (run.trial.kind !== "continuous_rating") throw new Error(`expected a continuous rating, got ${run.trial.kind}`);
  return run.trial;
}
