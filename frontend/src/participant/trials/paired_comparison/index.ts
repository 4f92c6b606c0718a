/** The paired comparison as the registry of trial kinds finds it. */
import { trial } from "../../jspsych";
import { parametersOf } from "../shared/parameters";
import type { TrialKind } from "../kind";
import { pairCheck } from "./attention-check";
import { comparison, unrated } from "./screen";
import "../shared/answers.css";

export const kind: TrialKind = {
  node: (session, what) => trial(comparison(session), parametersOf(session, what)),
  attention: (session, what) => trial(pairCheck(session), { trial: () => what().trial }),
  unrated,
};
