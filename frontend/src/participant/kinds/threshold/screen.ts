/** A trial of an adaptive series: ready, one clip or two in turn, then which answer. */
import type { TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { BOOL, FLOAT, plugin, STRING, type PluginClass, OBJECT, pressWhile, trial } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { type Session, type RatingBody, begin, type TrialKind } from "../../session";
import { saveRating } from "../../trials/rating";
import { type Chosen, askAttention } from "../../trials/answers";
import { unlessBroken, procedureFeedback, PARAMETERS, type TrialParameters, release, parametersOf } from "../../trials/trial";
import { prepareInTurn, showInTurn, clipsOf } from "../../trials/in-turn";
import { waitForStart, clipSize, showStage, type Stage, sayAlreadySeen } from "../../trials/showing";
import { beginView, type RolesShown, spanOf, timesOf, viewsBefore } from "../../views/ledger";
import { askResponse, type Response, type ThresholdData, awaitChoice, thresholdBody, declaredThreshold } from "./answer";
import "../../trials/answers.css";

function thresholdTrial(session: Session): PluginClass<TrialParameters> {
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
  // The server may still be choosing this trial's clip from the answer before.
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
function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
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
  // The question does not wait for it: what the page does next is not on the disk's time.
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

// An instructed answer between trials: the same buttons without clips.

interface Parameters {
  trial: TrialInfo;
}
interface Data {
  chosen: string;
}

function thresholdCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "threshold-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { chosen: STRING }, // the answer given
    show: (display, { trial }) => check(session, display, trial),
    async simulate({ trial }) {
      const asked = Number(/\*\*(\d)\*\*/.exec(trial.prompt ?? "")?.[1] ?? "1");
      const chosen = declaredThreshold(session).answers[asked === 2 ? 1 : 0].response;
      await store(session, trial, chosen, 0);
      return { chosen };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<Data> {
  const { answer, rt } = await askAttention(session, display, trial, (below, question) => askResponse(session, below, question));
  await store(session, trial, answer.name, rt);
  return { chosen: answer.name };
}

function store(session: Session, trial: TrialInfo, chosen: Response, rt: number): Promise<void> {
  return saveRating(session, trial, thresholdBody(session, trial, 1, chosen, playbackRecord(null, [], session.screen.record()), { rt }));
}

// The threshold as the registry of trial kinds finds it.

export const kind: TrialKind = {
  node: (session, what) => trial(thresholdTrial(session), parametersOf(session, what)),
  attention: (session, what) => trial(thresholdCheck(session), { trial: () => what().trial }),
  unrated,
};
