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
  const clips = bytesOf(session, trial);
  return { batch: tickets.batch, ticket, digest: clips ? await clipDigest(ticket, clips) : null, interaction };
}

/** The bytes of every clip of a trial, in the order of their places; null where one is not here. */
function bytesOf(session: Session, trial: TrialInfo): ArrayBuffer[] | null {
  const parts: ArrayBuffer[] = [];
  for (const { clip_sha256 } of trial.clips) {
    const bytes = session.clips.get(clip_sha256);
    if (!bytes) return null;
    parts.push(bytes);
  }
  return parts.length ? parts : null;
}
