/** What an answer brings along: its ticket, the digest of its clip, and how the participant acted. */
import type { RatingEvidence, TrialInfo, ViewEvidence } from "../../api/schema";
import type { Session } from "../session";
import { clipDigest } from "./digest";

/** Null where the run has no tickets: it began before the server issued them. */
export async function evidenceFor(session: Session, trial: TrialInfo, play: number): Promise<RatingEvidence | null> {
  const interaction = session.interaction.take();
  const given = ticketOf(session, trial, play);
  const clips = given && bytesOf(session, trial);
  return given && { ...given, digest: clips ? await clipDigest(given.ticket, clips) : null, interaction };
}

/** The ticket of a play; null where the run has none. */
export function ticketOf({ run: { tickets } }: Session, { trial_index }: TrialInfo, play: number): ViewEvidence | null {
  const ticket = tickets?.by_trial[trial_index]?.[play - 1];
  return tickets && ticket ? { batch: tickets.batch, ticket } : null;
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
