/** The single-clip rating: ready, the clip at actual size, then the scale. The rating is kept before it ends. */
import type { TrialInfo } from "../../../api/schema";
import { ratingBody, saveRating } from "../../trials/rating";
import type { RatingBody, Session, TrialKind } from "../../session";
import { BOOL, FLOAT, INT, plugin, type PluginClass, OBJECT, pressWhile, trial } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { unlessBroken, procedureFeedback, PARAMETERS, type TrialParameters, prepareClip, release, parametersOf } from "../../trials/trial";
import { beginView, viewsBefore } from "../../views/ledger";
import { declaredRating, bodyOf, type ClipRatingData, loadWidgets, noAnswer, onlyResponse, rate, ready } from "./answer";
import { sayAlreadySeen, showOnce, type Shown, clipSize, showStage, type Stage } from "../../trials/showing";
import { absoluteNow } from "../../playback/protocol";
import { loadModule } from "../../../ui/load-module";

export type WatchAndRate = (session: Session, stage: Stage, parameters: TrialParameters) => Promise<RatingBody>;

/** `other` shows and asks in the place of this screen, in studies with a reference before each clip. */
function clipRating(session: Session, other: Promise<WatchAndRate> | null): PluginClass<TrialParameters> {
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
  // While the person answers, so that the next trial need not wait.
  if (next) void prepareClip(session, next, null).catch(() => {});
  const rated = await rating;
  const body = bodyOf(session, parameters, showings, rated);
  if (trial.kind === "practice") await procedureFeedback(session, stage, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
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

/** What is stored of a play without an answer. */
function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = { ...playbackRecord(trial.clip_sha256, [], session.screen.record()), frames_missing: trial.frames ?? 0 };
  return ratingBody(session, trial, play, noAnswer(declaredRating(session)), playback);
}

// The single-clip rating as the registry of trial kinds finds it.

/** The code that draws checks loads during the first trial, which does not wait for it. It is here before a check. */
function attentionCheck(session: Session): PluginClass<{ trial: TrialInfo }> {
  const loaded = loadModule(() => import("./attention-check"));
  return plugin<{ trial: TrialInfo }, { response: number }>({
    name: "attention-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { response: INT }, // the answer given
    show: async (display, parameters) => (await loaded).check(session, display, parameters.trial),
    async simulate(parameters) {
      const { check_scale } = declaredRating(session);
      // The prompt has the number to press between two stars on either side.
      const response = Number(/\*\*(\d+)\*\*/.exec(parameters.trial.prompt ?? "")?.[1] ?? check_scale.minimum);
      const answers = { [check_scale.name]: { response } };
      const rated = { answers, at_ms: {}, answered_at_ms: absoluteNow(), changes: 0, comment: null };
      await (await loaded).store(session, parameters.trial, rated, 0);
      return { response };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

export const kind: TrialKind = {
  node: (session, what) => {
    // Asked for now, so that no scale waits; what cannot be had is asked for again where it is shown.
    const { scales, reference } = declaredRating(session);
    void loadWidgets(scales).catch(() => {});
    const other = reference && loadModule(() => import("./degradation")).then(({ watchBothAndRate }) => watchBothAndRate);
    return trial(clipRating(session, other), parametersOf(session, what));
  },
  attention: (session, what) => trial(attentionCheck(session), { trial: () => what().trial }),
  unrated,
};
