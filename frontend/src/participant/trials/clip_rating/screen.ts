/** The single-clip rating: ready, the clip at actual size, then the scale. The rating is kept before it ends. */
import type { TrialInfo } from "../../../api/schema";
import { ratingBody, type RatingBody } from "../rating";
import { BOOL, FLOAT, INT, plugin, type PluginClass } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { unlessBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { beginView, spanOf, timesOf, viewsBefore } from "../../views/ledger";
import { declaredRating } from "./declared";
import { PARAMETERS, type TrialParameters } from "../shared/parameters";
import { prepareClip, release } from "../shared/prepare";
import { answerOf, noAnswer, onlyResponse } from "./answer";
import { askInOrder, type Rated } from "./scale";
import { sayAlreadySeen } from "../shared/already-seen";
import { showOnce, type Shown, waitForStart } from "../shared/showing";
import { clipSize, showStage, type Stage } from "../shared/stage";

export type WatchAndRate = (session: Session, stage: Stage, parameters: TrialParameters) => Promise<RatingBody>;

export interface ClipRatingData {
  response: number | null;
  rt: number | null;
  frames_missing: number | null;
  key_to_first_frame_ms: number | null;
  again: boolean;
}

/** `other` shows and asks in the place of this screen, in studies with a reference before each clip. */
export function clipRating(session: Session, other: Promise<WatchAndRate> | null): PluginClass<TrialParameters> {
  return plugin<TrialParameters, ClipRatingData>({
    name: "clip-rating",
    parameters: PARAMETERS,
    data: {
      response: INT, // the rating; null for none
      rt: FLOAT, // from the last frame to the answer, ms
      frames_missing: INT, // frames never drawn
      key_to_first_frame_ms: FLOAT, // from key to first frame, ms
      again: BOOL, // whether this was a repetition
    },
    show: async (display, parameters) => runTrial(session, display, parameters, (await other) ?? watchAndRate),
    simulate: async (parameters) => (await import("./simulate")).simulatedRating(session, parameters),
    act: async (display) => (await import("./simulate")).actRating(display),
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: TrialParameters, show: WatchAndRate): Promise<ClipRatingData> {
  const { trial } = parameters;
  const stage = showStage(session, display, () => clipSize(session, trial));
  const body = await show(session, stage, parameters).catch(
    unlessBroken(session, display, trial, () => unrated(session, trial, parameters.play)),
  );
  await saveRating(session, trial, body);
  release(session, trial, parameters.next);
  const { frames_missing, key_to_first_frame_ms } = body.playback;
  const response = body.answer.kind === "clip_rating" ? onlyResponse(body.answer.answers) : null;
  return { response, rt: body.rt, frames_missing, key_to_first_frame_ms, again: parameters.play > 1 };
}

async function watchAndRate(session: Session, stage: Stage, parameters: TrialParameters): Promise<RatingBody> {
  const { trial, next, play } = parameters;
  const before = viewsBefore(trial, play).flatMap((view) => view.map(({ showing }) => showing));
  const showings = before.length < declaredRating(session).views ? await watch(session, stage, parameters, before) : before;
  if (showings === before) sayAlreadySeen(session, stage);
  const rating = rate(session, stage);
  if (next) void prepareClip(session, next, null).catch(() => {});
  const rated = await rating;
  const body = bodyOf(session, parameters, showings, rated);
  if (trial.kind === "practice") await procedureFeedback(session, stage, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
}

/** The ready screen before a view of the clip. */
export function ready(session: Session, stage: Stage, { number, total, play, trial }: TrialParameters, view: number): Promise<number> {
  const { t } = session;
  const { views, pointer_delay_ms } = declaredRating(session);
  const touch = matchMedia("(pointer: coarse)").matches;
  const first = t(touch ? "ready_touch" : "ready");
  const prompt = view > 1 ? t(touch ? "ready_again_touch" : "ready_again", { view, views }) : first;
  const key = trial.kind === "practice" ? "practice_note" : "trial_of";
  const note = play > 1 && trial.kind !== "practice" ? t("ready_replay") : t(key, { number, total });
  return waitForStart(session, stage, prompt, note, pointer_delay_ms);
}

async function watch(session: Session, stage: Stage, parameters: TrialParameters, before: Shown[]): Promise<Shown[]> {
  const { play, trial } = parameters;
  const { views, start, fixation_ms } = declaredRating(session);
  const sha256 = await prepareClip(session, trial, stage);
  const showings = [...before];
  for (let view = before.length + 1; view <= views; view += 1) {
    const key_at_ms = await ready(session, stage, parameters, view);
    const ledger = beginView(session, trial, play);
    const shown = showOnce(session, stage, sha256, key_at_ms, start === "fixation" ? fixation_ms : 0, ledger.kept);
    const showing = await ledger.unlessBroken(shown);
    showings.push(showing);
    // The scale does not wait for it: what the page does next is not on the disk's time.
    void ledger.end([{ roles: ["shown"], showing }]);
    if (showings.some((shown) => shown.focus_lost > 0)) session.events.add("focus_lost", { trial_index: trial.trial_index });
  }
  return showings;
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

/** What is stored of a play without an answer. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = { ...playbackRecord(trial.clip_sha256, [], session.screen.record()), frames_missing: trial.frames ?? 0 };
  return ratingBody(session, trial, play, noAnswer(declaredRating(session)), playback);
}
