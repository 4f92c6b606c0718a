/** What the page sends of one play, and how it is kept until the server has it. */
import type { TrialInfo } from "../../api/schema";
import { clockTime, count, duration } from "../measured";
import type { PlaybackRecord } from "../playback/record";
import { type Session, type RatingBody, receiptOf, applyNext, nextOf } from "../session";
import { evidenceFor } from "../evidence/evidence";
import type { Outcome } from "../outbox/outbox";
import { sourcesOf } from "../screens/preload";
import { waitShown } from "../screens/support";

const LONGEST_COMMENT = 5_000;
type Given = Partial<Pick<RatingBody, "rt" | "rt_from_first_frame" | "changes" | "comment">>;

/** A play and its answer, at this moment; what is not given was not measured, changed or said. */
export function ratingBody(
  session: Session,
  { trial_index }: TrialInfo,
  play: number,
  answer: RatingBody["answer"],
  playback: PlaybackRecord,
  given: Given = {},
): RatingBody {
  return {
    trial_index,
    play,
    answer,
    rt: null,
    rt_from_first_frame: null,
    time_elapsed: duration(session.clock.elapsed()),
    changes: 0,
    comment: null,
    answered_at_client: clockTime(),
    playback,
    ...given,
    ...(given.changes === undefined ? {} : { changes: count(given.changes) ?? 0 }),
    // As long as the server keeps one.
    ...(given.comment ? { comment: given.comment.slice(0, LONGEST_COMMENT) } : {}),
  };
}

// Keeps a rating, and acts on its receipt whenever that comes: a failed clip joins the repetitions.

/** Resolves when the rating is on disk; where nothing is kept there, when the server has it. */
export async function saveRating(session: Session, trial: TrialInfo, body: RatingBody): Promise<void> {
  const id = crypto.randomUUID();
  const evidence = await evidenceFor(session, trial, body.play);
  const { receipt } = await session.outbox.put("PUT", `/api/run/ratings/${id}`, { ...body, evidence }, id);
  trial.plays_done = body.play;
  trial.answered = true;
  const shift_ms = session.clock.shift();
  if (shift_ms !== 0) session.events.add("clock_changed", { shift_ms });
  const handled = receipt.then((outcome) => {
    takeNext(session, outcome);
    const { again, warning } = receiptOf(outcome) ?? {};
    if (again) session.replays.add(trial, body.play + 1);
    if (warning) session.warnings.push(warning);
    // Another page has answered this trial meanwhile: only one of them may go on.
    if (!outcome.accepted && outcome.refused.code === "rating_differs") session.root.dispatchEvent(new CustomEvent("taken-over"));
  });
  if (!session.outbox.durable) await waitShown(session, handled);
}

const INTERRUPTED_WAIT_MS = 5000;

/** A play whose view was broken off has no answer; the trial comes once more at the end of its block. */
export async function saveInterrupted(session: Session, trial: TrialInfo, play: number): Promise<void> {
  // The page has just been loaded: what shows that the play's clip was fetched needs its bytes. A network that
  // hangs holds nobody up for long.
  await Promise.race([session.clips.load(sourcesOf([trial])), new Promise((go) => setTimeout(go, INTERRUPTED_WAIT_MS))]);
  const body = (trial.kind === "check" ? session.checks : session.kind).unrated(session, trial, play);
  await saveRating(session, trial, { ...body, playback: { ...body.playback, disturbances: { interrupted: 1 } } });
  // The page began with this play among those owed.
  session.replays.drop(trial, play);
  if (trial.kind === "main" && play <= session.run.playback.max_repeats) session.replays.add(trial, play + 1);
}

/** Where answers decide what comes next: the chosen trials, and their clips fetched before their turn. */
function takeNext(session: Session, outcome: Outcome): void {
  const next = outcome.accepted ? nextOf(outcome.body) : null;
  if (!next) return;
  void session.clips.load(sourcesOf(applyNext(session.run.trials, next)));
}
