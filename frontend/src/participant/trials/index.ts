/** One folder for each kind of trial. A paired comparison would join here. */
import type { ShownClipRating, TrialInfo } from "../../api/schema";
import { trial, type Node } from "../jspsych";
import type { Session } from "../session";
import { attentionCheck } from "./attention-check";
import { clipRating, placeIn } from "./clip-rating/plugin";

export interface Showable {
  trial: TrialInfo;
  play: number;
  next: TrialInfo | null;
}
type Maker = (session: Session, what: () => Showable) => Node;

const kinds: Record<ShownClipRating["kind"], Maker> = {
  clip_rating: (session, what) =>
    trial(clipRating(session), {
      trial: () => what().trial,
      play: () => what().play,
      next: () => what().next,
      number: () => placeIn(session, what().trial).number,
      total: () => placeIn(session, what().trial).total,
    }),
};

/** The timeline node that shows what `what` names when its turn comes. */
export function trialNode(session: Session, kind: TrialInfo["kind"], what: () => Showable): Node {
  if (kind === "attention") return trial(attentionCheck(session), { trial: () => what().trial });
  return kinds[session.run.trial.kind](session, what);
}
