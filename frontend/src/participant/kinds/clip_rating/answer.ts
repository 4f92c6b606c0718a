/** One play of a clip: the ready screen, the scales below it, and what is sent of their answers. */
import type { ShownClipRating, RatingAnswer } from "../../../api/schema";
import type { Session, RatingBody } from "../../session";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import { spanOf, timesOf } from "../../views/ledger";
import { ratingBody } from "../../trials/rating";
import type { TrialParameters } from "../../trials/trial";
import { type Shown, waitForStart, type Stage } from "../../trials/showing";
import { duration } from "../../measured";
import { askInOrder, type Rated } from "./scale";

// The declaration of a run whose trials are ratings of single clips.

export function declaredRating({ run }: Session): ShownClipRating {
  if (run.trial.kind !== "clip_rating") throw new Error(`expected ratings of single clips, got ${run.trial.kind}`);
  return run.trial;
}

// The answers to one clip as the server is sent them.

/** What jsPsych's own data hold of a trial. */
export interface ClipRatingData {
  response: number | null;
  rt: number | null;
  frames_missing: number | null;
  key_to_first_frame_ms: number | null;
  again: boolean;
}

/** The ready screen before a view of the clip. */
export function ready(session: Session, stage: Stage, { number, total, play, trial }: TrialParameters, view: number): Promise<number> {
  const { t } = session;
  const { views, pointer_delay_ms } = declaredRating(session);
  // Asked for at each view: a tablet may have a mouse by now.
  const touch = matchMedia("(pointer: coarse)").matches;
  const first = t(touch ? "ready_touch" : "ready");
  const prompt = view > 1 ? t(touch ? "ready_again_touch" : "ready_again", { view, views }) : first;
  const key = trial.kind === "practice" ? "practice_note" : "trial_of";
  // A repeated clip is announced, or it would seem to be a mistake.
  const note = play > 1 && trial.kind !== "practice" ? t("ready_replay") : t(key, { number, total });
  return waitForStart(session, stage, prompt, note, pointer_delay_ms);
}

export async function rate(session: Session, stage: Stage): Promise<Rated> {
  const { signal, done } = screenSignal(session);
  const { language, t } = session;
  const rated = await askInOrder(stage.below, declaredRating(session), { language, t, signal });
  done();
  return rated;
}

export function bodyOf(session: Session, { trial, play }: TrialParameters, showings: Shown[], rated: Rated): RatingBody {
  const { answered_at_ms, changes, comment } = rated;
  const span = spanOf(showings);
  const playback = playbackRecord(trial.clip_sha256, showings, session.screen.record());
  const given = { ...timesOf(span, answered_at_ms), changes, comment };
  return ratingBody(session, trial, play, answerOf(rated, span.ended_at_ms), playback, given);
}

/** `from_ms` is when the clip's last frame was drawn, where it is known. */
function answerOf({ answers, at_ms }: Rated, from_ms: number | undefined): RatingAnswer {
  const timed = Object.entries(answers).map(([name, given]) => {
    const at = at_ms[name];
    // Without a drawn last frame there is no moment to count from.
    const rt = at === undefined || from_ms === undefined ? null : duration(at - from_ms);
    return [name, { ...given, rt }];
  });
  return { kind: "clip_rating", answers: Object.fromEntries(timed) as RatingAnswer["answers"] };
}

/** No answer on any scale: the clip could not be shown. */
export function noAnswer({ scales }: ShownClipRating): RatingAnswer {
  const none = scales.map(({ name }) => [name, { response: null }]);
  return { kind: "clip_rating", answers: Object.fromEntries(none) as RatingAnswer["answers"] };
}

/** The one number where there is one scale; jsPsych's own data hold it. */
export function onlyResponse(answers: RatingAnswer["answers"]): number | null {
  const [first, ...more] = Object.values(answers);
  return first && more.length === 0 ? first.response : null;
}
