/** The single-clip rating as the registry of trial kinds finds it. */
import { trial } from "../../jspsych";
import type { TrialKind } from "../kind";
import { attentionCheck } from "./attention-check";
import { placeIn } from "../shared/place";
import { clipRating, unrated } from "./screen";

export const kind: TrialKind = {
  node: (session, what) =>
    trial(clipRating(session), {
      trial: () => what().trial,
      play: () => what().play,
      next: () => what().next,
      number: () => placeIn(session, what().trial).number,
      total: () => placeIn(session, what().trial).total,
    }),
  attention: (session, what) => trial(attentionCheck(session), { trial: () => what().trial }),
  unrated,
};
