/** The paired comparison as the registry of trial kinds finds it. */
import { trial } from "../../jspsych";
import { placeIn } from "../shared/place";
import type { TrialKind } from "../kind";
import { pairCheck } from "./attention-check";
import { comparison, unrated } from "./screen";
import "../shared/answers.css";

export const kind: TrialKind = {
  node: (session, what) =>
    trial(comparison(session), {
      trial: () => what().trial,
      play: () => what().play,
      next: () => what().next,
      number: () => placeIn(session, what().trial).number,
      total: () => placeIn(session, what().trial).total,
    }),
  attention: (session, what) => trial(pairCheck(session), { trial: () => what().trial }),
  unrated,
};
