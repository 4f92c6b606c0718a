/** The threshold as the registry of trial kinds finds it. */
import { trial } from "../../jspsych";
import type { TrialKind } from "../kind";
import { placeIn } from "../shared/place";
import { thresholdCheck } from "./attention-check";
import { thresholdTrial, unrated } from "./screen";
import "../shared/answers.css";

export const kind: TrialKind = {
  node: (session, what) =>
    trial(thresholdTrial(session), {
      trial: () => what().trial,
      play: () => what().play,
      next: () => what().next,
      number: () => placeIn(session, what().trial).number,
      total: () => placeIn(session, what().trial).total,
    }),
  attention: (session, what) => trial(thresholdCheck(session), { trial: () => what().trial }),
  unrated,
};
