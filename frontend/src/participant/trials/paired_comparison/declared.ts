/** The declaration of a run whose trials are paired comparisons. */
import type { ShownPairedComparison } from "../../../api/schema";
import type { Session } from "../../session";

export function declaredPairs({ run }: Session): ShownPairedComparison {
  if (run.trial.kind !== "paired_comparison") throw new Error(`expected a paired comparison, got ${run.trial.kind}`);
  return run.trial;
}
