/** The paired comparison: ready, the clips, then which of them. The answer is kept before the trial ends. */
import type { TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { BOOL, FLOAT, plugin, STRING, type PluginClass } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import type { Session } from "../../session";
import { unlessBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { sayAlreadySeen } from "../shared/already-seen";
import { waitForStart } from "../shared/showing";
import type { Stage } from "../shared/stage";
import { ratingBody, type RatingBody } from "../rating";
import { saveRating } from "../save-rating";
import { askWinner, type Compared } from "./answers";
import { clipsOf } from "../shared/roles";
import { PARAMETERS, type TrialParameters } from "../shared/parameters";
import { beginView, type RolesShown, spanOf, timesOf, viewsBefore } from "../../views/ledger";
import { declaredPairs } from "./declared";
import type { Arrangement, Layout } from "./layout";
import { preparePair, releasePair, showAll } from "./pair-player";
import { stageFor } from "./pair-stage";

export interface ComparisonData {
  winner: string | null;
  rt: number | null;
  again: boolean;
}

export function comparison(session: Session): PluginClass<TrialParameters> {
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
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
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
