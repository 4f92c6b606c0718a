/** What the screen of a trial is given, whatever its kind: the trial, its play, and which it is among those of its part. */
import type { TrialInfo } from "../../../api/schema";
import { INT, OBJECT } from "../../jspsych";
import { counted, type Session } from "../../session";
import type { Showable } from "../kind";

export interface TrialParameters extends Showable {
  number: number;
  total: number;
}

export const PARAMETERS = {
  trial: OBJECT, // the assigned trial
  play: INT, // 1, or more for a repetition
  next: OBJECT, // the trial after this one
  number: INT, // its place among those counted
  total: INT, // how many those are at most
};

/** The parameters as functions, asked when the trial's turn comes. */
export function parametersOf(session: Session, what: () => Showable) {
  return {
    trial: () => what().trial,
    play: () => what().play,
    next: () => what().next,
    number: () => numbering(session, what().trial).number,
    total: () => numbering(session, what().trial).total,
  };
}

/** Which trial this is among those of its part, for the participant. */
export function numbering(session: Session, trial: TrialInfo): { number: number; total: number } {
  const kind = trial.kind === "practice" ? session.run.trials.filter((one) => one.kind === "practice") : counted(session.run);
  return { number: kind.findIndex((one) => one.trial_index === trial.trial_index) + 1, total: kind.length };
}
