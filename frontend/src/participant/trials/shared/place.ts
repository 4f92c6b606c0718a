/** Which trial this is among those of its part, for the participant. */
import type { TrialInfo } from "../../../api/schema";
import { counted, type Session } from "../../session";

export function placeIn(session: Session, trial: TrialInfo): { number: number; total: number } {
  const kind = trial.kind === "practice" ? session.run.trials.filter((one) => one.kind === "practice") : counted(session.run);
  return { number: kind.findIndex((one) => one.trial_index === trial.trial_index) + 1, total: kind.length };
}
