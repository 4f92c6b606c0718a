/** The paired comparison: ready, the clips, then which of them. The answer is kept before the trial ends. */
import type { TrialClip, TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { ClipBroken, type Part } from "../../playback/protocol";
import type { Session, RatingBody, TrialKind } from "../../session";
import {
  release,
  whileDecoding,
  decodeAll,
  unlessBroken,
  procedureFeedback,
  PARAMETERS,
  type TrialParameters,
  parametersOf,
} from "../../trials/trial";
import { showOnce, type Stage, clipSize, inWindow, showStage, sayAlreadySeen, waitForStart } from "../../trials/showing";
import { type RolesShown, beginView, spanOf, timesOf, viewsBefore } from "../../views/ledger";
import { declaredPairs, askWinner, type Compared, type ComparisonData, winnerOf, type Winner } from "./answer";
import { type Layout, type ClipBox, layoutOf, roomNeeded, type Arrangement } from "./layout";
import { askRoom } from "../../screens/screen-setup";
import { h } from "../../../ui/element";
import { BOOL, FLOAT, plugin, STRING, type PluginClass, OBJECT, pressWhile, trial } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import { ratingBody, saveRating } from "../../trials/rating";
import { clipsOf } from "../../trials/in-turn";
import { askAttention } from "../../trials/answers";
import "../../trials/answers.css";

// Two clips made ready on one canvas, and shown: at once by one clock, or in turn with the declared gap.

/** One step of a trial: what the canvas shows, and for how long it stays plain before. */
interface Step {
  id: string;
  roles: string[];
  gap_ms: number;
  label: string;
}

/** Fetch, decode and compose everything the trial shows. Throws ClipBroken. */
function preparePair(session: Session, trial: TrialInfo, layout: Layout, stage: Stage): Promise<Step[]> {
  return whileDecoding(session, stage, async () => {
    await decodeAll(session, trial);
    const steps = await Promise.all(planned(session, trial, layout).map(({ step, parts }) => composed(session, layout, step, parts)));
    const first = steps[0];
    if (first) session.player.blank(first.id);
    return steps;
  });
}

function planned(session: Session, trial: TrialInfo, layout: Layout): { step: Step; parts: Part[] }[] {
  const { presentation, reference } = declaredPairs(session);
  const named = (role: string): TrialClip[] => trial.clips.filter((clip) => clip.role === role);
  const part = (clip: TrialClip, at: ClipBox): Part => ({ sha256: clip.clip_sha256, ...at });
  const single = (clip: TrialClip, gap_ms: number, label: string): { step: Step; parts: Part[] } => ({
    step: { id: `${trial.trial_index} ${clip.role}`, roles: [clip.role], gap_ms, label },
    parts: [part(clip, layout.single)],
  });
  const before = named("reference").map((clip) => single(clip, 0, reference ? pick(reference.label, session.language) : ""));
  const after_ms = before.length && reference ? reference.gap_ms : 0;
  if (presentation.arrangement === "one_after_the_other") {
    const [first, second] = [...named("first"), ...named("second")];
    if (!first || !second) throw new ClipBroken("expected a first and a second clip");
    return [...before, single(first, after_ms, ""), single(second, presentation.gap_ms, "")];
  }
  const [left, right] = [...named("left"), ...named("right")];
  if (!left || !right) throw new ClipBroken("expected a left and a right clip");
  const step = { id: `${trial.trial_index} pair`, roles: ["left", "right"], gap_ms: after_ms, label: "" };
  return [...before, { step, parts: [part(left, layout.boxes[0]), part(right, layout.boxes[1])] }];
}

async function composed(session: Session, { canvas }: Layout, step: Step, parts: Part[]): Promise<Step> {
  await session.player.compose(step.id, parts, canvas.width, canvas.height);
  return step;
}

/** Show every step; a view's times count from the press that started it. */
async function showAll(session: Session, stage: Stage, steps: Step[], key_at_ms: number, kept: Promise<void>): Promise<RolesShown[]> {
  const shown = [];
  for (const { id, roles, gap_ms, label } of steps) {
    if (gap_ms > 0) {
      stage.setPlaying(true);
      await new Promise((resolve) => setTimeout(resolve, gap_ms));
    }
    const showing = await showOnce(session, stage, id, key_at_ms, 0, kept, label);
    if (showing.focus_lost > 0) session.events.add("focus_lost", { roles });
    shown.push({ roles, showing });
  }
  return shown;
}

/** Forget the pair's pictures; clips that the next trial shows again stay decoded. */
function releasePair(session: Session, trial: TrialInfo, next: TrialInfo | null): void {
  release(session, trial, next);
  for (const { role } of trial.clips) session.player.release(`${trial.trial_index} ${role}`);
  session.player.release(`${trial.trial_index} pair`);
}

// The place of a pair on the screen; where it does not fit, the participant is asked for a larger window.

export async function stageFor(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ stage: Stage; layout: Layout }> {
  const { presentation } = declaredPairs(session);
  const { px_per_mm } = session.screen;
  const shown = clipSize(session, trial);
  const pixels = { width: trial.width_px ?? shown.width, height: trial.height_px ?? shown.height };
  // Asked again until it fits: a window may be enlarged too little.
  for (;;) {
    const room = { width: window.innerWidth, height: window.innerHeight };
    const layout = layoutOf(presentation, pixels, shown, room, px_per_mm);
    if (layout) {
      return { stage: showStage(session, display, () => inWindow(session, layout.shown, layout.canvas.width), "pair_name"), layout };
    }
    await askRoom(session, display, "", roomNeeded(presentation, shown, px_per_mm));
  }
}

function comparison(session: Session): PluginClass<TrialParameters> {
  return plugin<TrialParameters, ComparisonData>({
    name: "paired-comparison",
    parameters: PARAMETERS,
    data: {
      winner: STRING, // left, right or tie; null where the pair could not be shown
      rt: FLOAT, // from the last frame to the answer, ms
      again: BOOL, // true where this was a repetition
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: async (parameters) => (await import("./simulate")).simulatedComparison(session, parameters),
    act: async (display) => (await import("./simulate")).actComparison(display),
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: TrialParameters): Promise<ComparisonData> {
  const { trial, play, next } = parameters;
  const body = await watchAndCompare(session, display, parameters).catch(
    unlessBroken(session, display, trial, () => unrated(session, trial, play)),
  );
  await saveRating(session, trial, body);
  releasePair(session, trial, next);
  const winner = body.answer.kind === "paired_comparison" ? body.answer.winner : null;
  return { winner, rt: body.rt, again: play > 1 };
}

/** What is stored of a showing without an answer. */
function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const answer = { kind: "paired_comparison", winner: null, arrangement: null } as const;
  return ratingBody(session, trial, play, answer, playbackRecord(null, [], session.screen.record()));
}

async function watchAndCompare(session: Session, display: HTMLElement, parameters: TrialParameters): Promise<RatingBody> {
  const { trial, play } = parameters;
  const { stage, layout } = await stageFor(session, display, trial);
  const before = viewsBefore(trial, play).at(-1);
  if (before) sayAlreadySeen(session, stage);
  const shown = before ?? (await watch(session, stage, layout, parameters));
  const compared = await compare(session, stage, layout.arrangement);
  const body = bodyOf(session, parameters, layout.arrangement, shown, compared);
  const showings = shown.map(({ showing }) => showing);
  if (trial.kind === "practice") await procedureFeedback(session, stage, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
}

async function watch(session: Session, stage: Stage, layout: Layout, parameters: TrialParameters): Promise<RolesShown[]> {
  const { trial, play } = parameters;
  const pair = await preparePair(session, trial, layout, stage);
  const key_at_ms = await waitForStart(
    session,
    stage,
    readyText(session),
    note(session, parameters),
    declaredPairs(session).pointer_delay_ms,
  );
  const ledger = beginView(session, trial, play);
  const shown = await ledger.unlessBroken(showAll(session, stage, pair, key_at_ms, ledger.kept));
  // The question does not wait for it: what the page does next is not on the disk's time.
  void ledger.end(shown);
  return shown;
}

function readyText({ t }: Session): string {
  return t(matchMedia("(pointer: coarse)").matches ? "pair_ready_touch" : "pair_ready");
}

function note({ t }: Session, { play, trial, number, total }: TrialParameters): string {
  return play > 1 && trial.kind !== "practice"
    ? t("pair_replay")
    : t(trial.kind === "practice" ? "practice_note" : "trial_of", { number, total });
}

async function compare(session: Session, stage: Stage, arrangement: Arrangement): Promise<Compared> {
  const { signal, done } = screenSignal(session);
  const { language, t } = session;
  const trial = declaredPairs(session);
  const question = h("h1", { class: "question" }, pick(trial.question, language));
  const compared = await askWinner(stage.below, { trial, arrangement, language, t, signal, question });
  done();
  return compared;
}

function bodyOf(
  session: Session,
  { trial, play }: TrialParameters,
  arrangement: Arrangement,
  shown: RolesShown[],
  { winner, answered_at_ms }: Compared,
): RatingBody {
  const showings = shown.map(({ showing }) => showing);
  const playback = playbackRecord(trial.clips[0]?.clip_sha256 ?? null, showings, session.screen.record());
  const answer = { kind: "paired_comparison", winner, arrangement } as const;
  const times = timesOf(spanOf(showings), answered_at_ms);
  return ratingBody(session, trial, play, answer, { ...playback, clips: clipsOf(trial, shown) }, times);
}

// An instructed answer between pairs: the same buttons without clips.

interface Parameters {
  trial: TrialInfo;
}
interface Data {
  winner: string;
}

function pairCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "pair-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { winner: STRING }, // the answer given
    show: (display, { trial }) => check(session, display, trial),
    async simulate({ trial }) {
      const winner = winnerOf(/\*\*(\d)\*\*/.exec(trial.prompt ?? "")?.[1] ?? "1", true) ?? "left";
      await store(session, trial, winner, 0);
      return { winner };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<Data> {
  const { language, t } = session;
  const declared = declaredPairs(session);
  const { arrangement } = declared.presentation;
  const { answer, rt } = await askAttention(session, display, trial, (below, question, signal) =>
    askWinner(below, { trial: declared, arrangement, language, t, signal, question }),
  );
  await store(session, trial, answer.winner, rt);
  return { winner: answer.winner };
}

function store(session: Session, trial: TrialInfo, winner: Winner, rt: number): Promise<void> {
  const answer = { kind: "paired_comparison", winner, arrangement: null } as const;
  return saveRating(session, trial, ratingBody(session, trial, 1, answer, playbackRecord(null, [], session.screen.record()), { rt }));
}

// The paired comparison as the registry of trial kinds finds it.

export const kind: TrialKind = {
  node: (session, what) => trial(comparison(session), parametersOf(session, what)),
  attention: (session, what) => trial(pairCheck(session), { trial: () => what().trial }),
  unrated,
};
