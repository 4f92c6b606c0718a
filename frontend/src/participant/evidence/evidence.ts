/** What an answer brings along: its ticket, the digest of its clip, and how the participant acted. */
import type { RatingEvidence, TrialInfo } from "../../api/schema";
import type { Session } from "../session";
import { clipDigest } from "./digest";

/** Null where the run has no tickets: it began before the server issued them. */
export async function evidenceFor(session: Session, trial: TrialInfo, play: number): Promise<RatingEvidence | null> {
  const { tickets } = session.run;
  const ticket = tickets?.by_trial[trial.trial_index]?.[play - 1];
  const interaction = session.interaction.take();
  if (!tickets || !ticket) return null;
  const clip = trial.clip_sha256 === null ? undefined : session.clips.get(trial.clip_sha256);
  return { batch: tickets.batch, ticket, digest: clip ? await clipDigest(ticket, clip) : null, interaction };
}
