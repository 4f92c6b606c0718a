/** What a kind of trial is to the timeline: one folder each, named as the declaration names the kind. */
import type { TrialInfo } from "../../api/schema";
import type { Node } from "../jspsych";
import type { Session } from "../session";
import type { RatingBody } from "./rating";

export interface Showable {
  trial: TrialInfo;
  play: number;
  next: TrialInfo | null;
}
type Maker = (session: Session, what: () => Showable) => Node;

export interface TrialKind {
  /** A trial of the main part or of practice; `what` is asked when its turn comes. */
  node: Maker;
  /** An instructed answer between trials. */
  attention: Maker;
  /** What is stored of a play that nobody could answer: its clip could not be shown, or its view was broken off. */
  unrated(session: Session, trial: TrialInfo, play: number): RatingBody;
}
