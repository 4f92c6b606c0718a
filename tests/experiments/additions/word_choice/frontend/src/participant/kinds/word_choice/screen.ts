/** A clip, then which of two words describes it. */
import type { TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { BOOL, FLOAT, plugin, STRING, type PluginClass, OBJECT, pressWhile, trial } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { type Session, type RatingBody, begin, type TrialKind } from "../../session";
import { saveRating } from "../../trials/rating";
import { type Chosen, askAttention, actWhileShown } from "../../trials/answers";
import { unlessBroken, procedureFeedback, PARAMETERS, type TrialParameters, release, parametersOf } from "../../trials/trial";
import { prepareInTurn, showInTurn, clipsOf } from "../../trials/in-turn";
import { waitForStart, clipSize, showStage, type Stage, sayAlreadySeen } from "../../trials/showing";
import { beginView, type RolesShown, spanOf, timesOf, viewsBefore } from "../../views/ledger";
import { ratingBody } from "../../trials/rating";
import { screenSignal } from "../../screens/support";
import type { ShownWordChoice } from "../../../api/schema";
import { askAnswer } from "../../trials/answers";
import type { PlaybackRecord } from "../../playback/record";
import "../../trials/answers.css";

export type Word = "first" | "second";

/** What jsPsych's own data hold of a trial. */
export interface WordData {
  chosen: string | null;
  rt: number | null;
  again: boolean;
}

export function declaredWords({ run }: Session): ShownWordChoice {
  if (run.trial.kind !== "word_choice") throw new Error(`expected a choice of words, got ${run.trial.kind}`);
  return run.trial;
}

const KEYS = new Map<string, Word>([
  ["1", "first"],
  ["2", "second"],
  ["ArrowLeft", "first"],
  ["ArrowRight", "second"],
]);

async function askWord(session: Session, container: HTMLElement, question: HTMLElement): Promise<Chosen<Word>> {
  const { first, second, pointer_delay_ms } = declaredWords(session);
  const { signal, done } = screenSignal(session);
  const chosen = await askAnswer<Word>(container, {
    choices: [
      { name: "first", number: 1, label: pick(first, session.language) },
      { name: "second", number: 2, label: pick(second, session.language) },
    ],
    keyed: (key) => KEYS.get(key) ?? null,
    layout: "one_after_the_other",
    pointer_delay_ms,
    signal,
    question,
  });
  done();
  return chosen;
}

type Times = Partial<Pick<RatingBody, "rt" | "rt_from_first_frame">>;

export function wordBody(
  session: Session,
  trial: TrialInfo,
  play: number,
  chosen: Word | null,
  playback: PlaybackRecord,
  times: Times = {},
): RatingBody {
  return ratingBody(session, trial, play, { kind: "word_choice", chosen } as const, playback, times);
}

function wordTrial(session: Session): PluginClass<TrialParameters> {
  return plugin<TrialParameters, WordData>({
    name: "word-choice",
    parameters: PARAMETERS,
    data: {
      chosen: STRING, // the answer; null where the clips could not be shown
      rt: FLOAT, // from the last frame to the answer, ms
      again: BOOL, // true where this was a repetition
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: (parameters) => simulatedWord(session, parameters),
    act: actWord,
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: TrialParameters): Promise<WordData> {
  const { trial, play, next } = parameters;
  begin(trial);
  const body = await watchAndAnswer(session, display, parameters).catch(
    unlessBroken(session, display, trial, () => unrated(session, trial, play)),
  );
  await saveRating(session, trial, body);
  release(session, trial, next);
  const chosen = body.answer.kind === "word_choice" ? body.answer.chosen : null;
  return { chosen, rt: body.rt, again: play > 1 };
}

/** What is stored of a play without an answer. */
function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  return wordBody(session, trial, play, null, playbackRecord(null, [], session.screen.record()));
}

async function watchAndAnswer(session: Session, display: HTMLElement, parameters: TrialParameters): Promise<RatingBody> {
  const { trial, play } = parameters;
  const declared = declaredWords(session);
  const stage = showStage(session, display, () => clipSize(session, trial), trial.clips.length > 1 ? "pair_name" : "clip_name");
  const before = viewsBefore(trial, play).at(-1);
  if (before) sayAlreadySeen(session, stage);
  const shown = before ?? (await watch(session, stage, parameters));
  const question = h("h1", { class: "question" }, pick(declared.question, session.language));
  const answered = await askWord(session, stage.below, question);
  const body = bodyOf(session, parameters, shown, answered);
  const showings = shown.map(({ showing }) => showing);
  if (trial.kind === "practice") await procedureFeedback(session, stage, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
}

async function watch(session: Session, stage: Stage, parameters: TrialParameters): Promise<RolesShown[]> {
  const { trial, play } = parameters;
  const declared = declaredWords(session);
  await prepareInTurn(session, stage, trial, trial.clips);
  const key_at_ms = await waitForStart(session, stage, readyText(session, trial), note(session, parameters), declared.pointer_delay_ms);
  const ledger = beginView(session, trial, play);
  const shown = await ledger.unlessBroken(showInTurn(session, stage, trial, { clips: trial.clips, gap_ms: 0 }, key_at_ms, ledger.kept));
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

function bodyOf(session: Session, { trial, play }: TrialParameters, shown: RolesShown[], chosen: Chosen<Word>): RatingBody {
  const showings = shown.map(({ showing }) => showing);
  const playback = playbackRecord(trial.clip_sha256, showings, session.screen.record());
  const clips = trial.clips.length > 1 ? clipsOf(trial, shown) : null;
  const times = timesOf(spanOf(showings), chosen.answered_at_ms);
  return wordBody(session, trial, play, chosen.name, { ...playback, clips }, times);
}

// An instructed answer between trials: the same buttons without clips.

interface Parameters {
  trial: TrialInfo;
}
interface Data {
  chosen: string;
}

function wordCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "word-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { chosen: STRING }, // the answer given
    show: (display, { trial }) => check(session, display, trial),
    async simulate({ trial }) {
      const asked = Number(/\*\*(\d)\*\*/.exec(trial.prompt ?? "")?.[1] ?? "1");
      const chosen = asked === 2 ? "second" : "first";
      await store(session, trial, chosen, 0);
      return { chosen };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<Data> {
  const { answer, rt } = await askAttention(session, display, trial, (below, question) => askWord(session, below, question));
  await store(session, trial, answer.name, rt);
  return { chosen: answer.name };
}

function store(session: Session, trial: TrialInfo, chosen: Word, rt: number): Promise<void> {
  return saveRating(session, trial, wordBody(session, trial, 1, chosen, playbackRecord(null, [], session.screen.record()), { rt }));
}

// A simulated participant.

async function simulatedWord(session: Session, { trial, play }: TrialParameters): Promise<WordData> {
  const chosen = Math.random() < 0.5 ? "first" : "second";
  const rt = 300 + Math.round(Math.random() * 900);
  const playback = playbackRecord(trial.clip_sha256, [], session.screen.record());
  await saveRating(session, trial, wordBody(session, trial, play, chosen, playback, { rt, rt_from_first_frame: rt + 1_500 }));
  return { chosen, rt, again: play > 1 };
}

/** Presses start, then the second answer, then whatever goes on. */
function actWord(display: HTMLElement): void {
  actWhileShown(display, () => {
    const press = [...display.querySelectorAll<HTMLButtonElement>(".pair-answer")].at(-1);
    (press ?? display.querySelector<HTMLButtonElement>(".primary"))?.click();
  });
}

// The choice as the registry of trial kinds finds it.

export const kind: TrialKind = {
  node: (session, what) => trial(wordTrial(session), parametersOf(session, what)),
  attention: (session, what) => trial(wordCheck(session), { trial: () => what().trial }),
  unrated,
};
