/** Degradation category rating: the reference, plain background, then the clip that is rated; both are one view. */
import { pick } from "../../../i18n";
import type { Session, RatingBody } from "../../session";
import { beginView, type RolesShown, viewsBefore } from "../../views/ledger";
import { sayAlreadySeen, type Shown, type Stage } from "../../trials/showing";
import { decodeAll, procedureFeedback, type TrialParameters } from "../../trials/trial";
import { prepareInTurn, showInTurn, clipsOf } from "../../trials/in-turn";
import { declaredRating, bodyOf, rate, ready } from "./answer";

export async function watchBothAndRate(session: Session, stage: Stage, parameters: TrialParameters): Promise<RatingBody> {
  const { trial, play, next } = parameters;
  const before = viewsBefore(trial, play).at(-1);
  if (before) sayAlreadySeen(session, stage);
  const shown = before ?? (await watch(session, stage, parameters));
  const rating = rate(session, stage);
  // While the person answers, so that the next trial need not wait.
  if (next) void decodeAll(session, next).catch(() => {});
  const rated = await rating;
  const showings = shown.map(({ showing }) => showing);
  const body = bodyOf(session, parameters, showings, rated);
  if (trial.kind === "practice") await procedureFeedback(session, stage, { trial, play, showings, rt_ms: body.rt ?? 0 });
  const answer = body.answer.kind === "clip_rating" ? { ...body.answer, reference_gap_ms: gapOf(showings) } : body.answer;
  return { ...body, answer, playback: { ...body.playback, clips: clipsOf(trial, shown) } };
}

async function watch(session: Session, stage: Stage, parameters: TrialParameters): Promise<RolesShown[]> {
  const { trial, play } = parameters;
  const { reference, start, fixation_ms } = declaredRating(session);
  // The reference first, whatever the order of the trial's clips.
  const clips = ["reference", "shown"].flatMap((role) => trial.clips.filter((clip) => clip.role === role));
  await prepareInTurn(session, stage, trial, clips);
  const key_at_ms = await ready(session, stage, parameters, 1);
  const ledger = beginView(session, trial, play);
  const inTurn = {
    clips,
    gap_ms: reference?.gap_ms ?? 0,
    fixation_ms: start === "fixation" ? fixation_ms : 0,
    labels: { reference: reference ? pick(reference.label, session.language) : "" },
  };
  const shown = await ledger.unlessBroken(showInTurn(session, stage, trial, inTurn, key_at_ms, ledger.kept));
  // The scale does not wait for it: what the page does next is not on the disk's time.
  void ledger.end(shown);
  return shown;
}

/** From the reference's last frame to the rated clip's first, as they were drawn; null where no frame was logged. */
function gapOf(showings: readonly Shown[]): number | null {
  const [reference, rated] = showings;
  const last = reference?.drawn.at(-1)?.[1];
  const first = rated?.drawn[0]?.[1];
  return last === undefined || first === undefined ? null : Math.round((first - last) * 100) / 100;
}
