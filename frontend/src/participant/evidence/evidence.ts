/** What an answer brings along: its ticket, the digest of its clip, and how the participant acted. */
import type { RatingEvidence, TrialInfo, ViewEvidence } from "../../api/schema";
import type { Session } from "../session";

// That the clips of a trial are here: HMAC-SHA-256, keyed by the ticket, over the SHA-512 of each of them, joined.

export async function clipDigest(ticket: string, clips: ArrayBuffer[]): Promise<string> {
  const { subtle } = crypto;
  const hashes = await Promise.all(clips.map((clip) => subtle.digest("SHA-512", clip)));
  const key = await subtle.importKey("raw", new TextEncoder().encode(ticket), { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
  const digest = new Uint8Array(await subtle.sign("HMAC", key, await new Blob(hashes).arrayBuffer()));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

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
