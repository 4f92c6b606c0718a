/** A trial of an adaptive series: ready, one clip or two in turn, then which answer. */
import type { TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { BOOL, FLOAT, plugin, STRING, type PluginClass } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import type { RatingBody } from "../rating";
import { saveRating } from "../save-rating";
import type { Chosen } from "../shared/ask-answer";
import { unlessBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { begin } from "../shared/next-trials";
import { PARAMETERS, type TrialParameters } from "../shared/parameters";
import { prepareInTurn, showInTurn } from "../shared/in-turn";
import { release } from "../shared/prepare";
import { clipsOf } from "../shared/roles";
import { waitForStart } from "../shared/showing";
import { clipSize, showStage, type Stage } from "../shared/stage";
import { sayAlreadySeen } from "../shared/already-seen";
import { beginView, type RolesShown, spanOf, timesOf, viewsBefore } from "../../views/ledger";
import { askResponse, type Response } from "./answers";
import { awaitChoice } from "./await-choice";
import { thresholdBody } from "./body";
import { declaredThreshold } from "./declared";

export interface ThresholdData {
  chosen: string | null;
  rt: number | null;
  again: boolean;
}

export function thresholdTrial(session: Session): PluginClass<TrialParameters> {
  return plugin<TrialParameters, ThresholdData>({
    name: "threshold",
    parameters: PARAMETERS,
    data: {
      chosen: STRING, // the answer; null where the clips could not be shown
      rt: FLOAT, // from the last frame to the answer, ms
      again: BOOL, // true where this was a repetition
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: async (parameters) => (await import("./simulate")).simulatedThreshold(session, parameters),
    act: async (display) => (await import("./simulate")).actThreshold(display),
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: TrialParameters): Promise<ThresholdData> {
  const { trial, play, next } = parameters;
  await awaitChoice(session, display, trial);
  begin(trial);
  const body = await watchAndAnswer(session, display, parameters).catch(
    unlessBroken(session, display, trial, () => unrated(session, trial, play)),
  );
  await saveRating(session, trial, body);
  release(session, trial, next);
  const chosen = body.answer.kind === "threshold" ? body.answer.chosen : null;
  return { chosen, rt: body.rt, again: play > 1 };
}

/** What is stored of a play without an answer. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  return thresholdBody(session, trial, play, null, playbackRecord(null, [], session.screen.record()));
}

async function watchAndAnswer(session: Session, display: HTMLElement, parameters: TrialParameters): Promise<RatingBody> {
  const { trial, play } = parameters;
  const declared = declaredThreshold(session);
  const stage = showStage(session, display, () => clipSize(session, trial), trial.clips.length > 1 ? "pair_name" : "clip_name");
  const before = viewsBefore(trial, play).at(-1);
  if (before) sayAlreadySeen(session, stage);
  const shown = before ?? (await watch(session, stage, parameters));
  const question = h("h1", { class: "question" }, pick(declared.question, session.language));
  const answered = await askResponse(session, stage.below, question);
  const body = bodyOf(session, parameters, shown, answered);
  const showings = shown.map(({ showing }) => showing);
  if (trial.kind === "practice") await procedureFeedback(session, stage, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
}

async function watch(session: Session, stage: Stage, parameters: TrialParameters): Promise<RolesShown[]> {
  const { trial, play } = parameters;
  const declared = declaredThreshold(session);
  await prepareInTurn(session, stage, trial, trial.clips);
  const key_at_ms = await waitForStart(session, stage, readyText(session, trial), note(session, parameters), declared.pointer_delay_ms);
  const ledger = beginView(session, trial, play);
  const shown = await ledger.unlessBroken(
    showInTurn(session, stage, trial, { clips: trial.clips, gap_ms: declared.gap_ms }, key_at_ms, ledger.kept),
  );
  void ledger.end(shown);
  return shown;
}

function readyText({ t }: Session, trial: TrialInfo): string {
  const touch = matchMedia("(pointer: coarse)").matches;
  if (trial.clips.length > 1) return t(touch ? "pair_ready_touch" : "pair_ready");
  return t(touch ? "ready_touch" : "ready");
}

function note({ t }: Session, { play, trial, number, total }: TrialParameters): string {
  if (play > 1 && trial.kind !== "practice") return t(trial.clips.length > 1 ? "pair_replay" : "ready_replay");
  return t(trial.kind === "practice" ? "practice_note" : "trial_of", { number, total });
}

function bodyOf(session: Session, { trial, play }: TrialParameters, shown: RolesShown[], chosen: Chosen<Response>): RatingBody {
  const showings = shown.map(({ showing }) => showing);
  const playback = playbackRecord(trial.clip_sha256, showings, session.screen.record());
  const clips = trial.clips.length > 1 ? clipsOf(trial, shown) : null;
  const times = timesOf(spanOf(showings), chosen.answered_at_ms);
  return thresholdBody(session, trial, play, chosen.name, { ...playback, clips }, times);
}
