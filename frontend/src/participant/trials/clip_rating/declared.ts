/** The declaration of a run whose trials are ratings of single clips. */
import type { ShownClipRating } from "../../../api/schema";
import type { Session } from "../../session";

export function declaredRating({ run }: Session): ShownClipRating {
  if (run.trial.kind !== "clip_rating") throw new Error(`expected ratings of single clips, got ${run.trial.kind}`);
  return run.trial;
}
