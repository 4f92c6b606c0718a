/** The threshold as the registry of trial kinds finds it. */
import { trial } from "../../jspsych";
import type { TrialKind } from "../kind";
import { parametersOf } from "../shared/parameters";
import { thresholdCheck } from "./attention-check";
import { thresholdTrial, unrated } from "./screen";
import "../shared/answers.css";

export const kind: TrialKind = {
  node: (session, what) => trial(thresholdTrial(session), parametersOf(session, what)),
  attention: (session, what) => trial(thresholdCheck(session), { trial: () => what().trial }),
  unrated,
};
