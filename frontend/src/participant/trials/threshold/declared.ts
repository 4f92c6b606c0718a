/** The declaration of a run whose trials belong to adaptive series. */
import type { ShownThreshold } from "../../../api/schema";
import type { Session } from "../../session";

export function declaredThreshold({ run }: Session): ShownThreshold {
  if (run.trial.kind !== "threshold") throw new Error(`expected a threshold, got ${run.trial.kind}`);
  return run.trial;
}
