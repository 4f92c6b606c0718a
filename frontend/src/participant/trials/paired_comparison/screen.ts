/** The paired comparison: ready, the clips, then which of them. The answer is kept before the trial ends. */
import type { TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { BOOL, FLOAT, INT, OBJECT, plugin, STRING, type PluginClass } from "../../jspsych";
import { ClipBroken } from "../../playback/player";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import type { Session } from "../../session";
import { showBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { sayAlreadySeen } from "../shared/already-seen";
import { waitForStart } from "../shared/showing";
import type { Stage } from "../shared/stage";
import type { RatingBody } from "../rating";
import { saveRating } from "../save-rating";
import { askWinner, type Compared } from "./answers";
import { clipsOf } from "../shared/roles";
import { comparisonBody } from "./body";
import { beginView, isFromBefore, type RolesShown, viewsBefore } from "../../views/ledger";
import { declaredPairs } from "./declared";
import type { Arrangement, Layout } from "./layout";
import { preparePair, releasePair, showAll } from "./pair-player";
import { stageFor } from "./pair-stage";

export interface ComparisonParameters {
  trial: TrialInfo;
  play: number;
  next: TrialInfo | null;
  number: number;
  total: number;
}
export interface ComparisonData {
  winner: string | null;
  rt: number | null;
  again: boolean;
}

export function comparison(session: Session): PluginClass<ComparisonParameters> {
  return plugin<ComparisonParameters, ComparisonData>({
    name: "paired-comparison",
    parameters: {
      trial: { type: OBJECT, description: "the assigned trial" },
      play: { type: INT, description: "1, or more where a failed pair is shown again" },
      next: { type: OBJECT, description: "the trial after this one" },
      number: { type: INT, description: "place of this trial among those counted, from 1" },
      total: { type: INT, description: "how many there are" },
    },
    data: {
      winner: { type: STRING, description: "left, right or tie; null where the pair could not be shown" },
      rt: { type: FLOAT, description: "from the last frame to the answer, ms" },
      again: { type: BOOL, description: "true where this was a repetition" },
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: async (parameters) => (await import("./simulate")).simulatedComparison(session, parameters),
    act: actTrial,
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: ComparisonParameters): Promise<ComparisonData> {
  const { trial, play, next } = parameters;
  const body = await watchAndCompare(session, display, parameters).catch(async (error: unknown) => {
    if (!(error instanceof ClipBroken)) throw error;
    const clips = trial.clips.map(({ clip_sha256 }) => clip_sha256);
    session.events.add("clip_unavailable", { clip_sha256: clips[0], clips, reason: error.message });
    await showBroken(session, display);
    return unrated(session, trial, play);
  });
  await saveRating(session, trial, body);
  releasePair(session, trial, next);
  const winner = body.answer.kind === "paired_comparison" ? body.answer.winner : null;
  return { winner, rt: body.rt, again: play > 1 };
}

/** What is stored of a showing without an answer. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const given = { winner: null, arrangement: null, rt: null, rt_from_first_frame: null, time_elapsed: session.clock.elapsed() };
  return comparisonBody(trial, play, given, playbackRecord(null, [], session.screen.record()));
}

async function watchAndCompare(session: Session, display: HTMLElement, parameters: ComparisonParameters): Promise<RatingBody> {
  const { trial, play } = parameters;
  const { place, layout } = await stageFor(session, display, trial);
  const before = viewsBefore(trial, play).at(-1);
  if (before) sayAlreadySeen(session, place);
  const shown = before ?? (await watch(session, place, layout, parameters));
  const compared = await compare(session, place, layout.arrangement);
  const body = bodyOf(session, parameters, layout.arrangement, shown, compared);
  const showings = shown.map(({ showing }) => showing);
  if (trial.kind === "practice") await procedureFeedback(session, place, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
}

async function watch(session: Session, place: Stage, layout: Layout, parameters: ComparisonParameters): Promise<RolesShown[]> {
  const { trial, play } = parameters;
  const pair = await preparePair(session, trial, layout, place);
  const key_at_ms = await waitForStart(
    session,
    place,
    readyText(session),
    note(session, parameters),
    declaredPairs(session).pointer_delay_ms,
  );
  const ledger = beginView(session, trial, play);
  const shown = await ledger.unlessBroken(showAll(session, place, pair, key_at_ms, ledger.kept));
  // The question does not wait for it: what the page does next is not on the disk's time.
  void ledger.end(shown);
  return shown;
}

function readyText({ t }: Session): string {
  return t(matchMedia("(pointer: coarse)").matches ? "pair_ready_touch" : "pair_ready");
}

function note({ t }: Session, { play, trial, number, total }: ComparisonParameters): string {
  return play > 1 && trial.kind !== "practice"
    ? t("pair_replay")
    : t(trial.kind === "practice" ? "practice_note" : "trial_of", { number, total });
}

async function compare(session: Session, place: Stage, arrangement: Arrangement): Promise<Compared> {
  const { signal, done } = screenSignal(session);
  const { language, t } = session;
  const trial = declaredPairs(session);
  const question = h("h1", { class: "question" }, pick(trial.question, language));
  const compared = await askWinner(place.below, { trial, arrangement, language, t, signal, question });
  done();
  return compared;
}

function bodyOf(
  session: Session,
  { trial, play }: ComparisonParameters,
  arrangement: Arrangement,
  shown: RolesShown[],
  { winner, answered_at_ms }: Compared,
): RatingBody {
  const showings = shown.map(({ showing }) => showing);
  const last = showings.at(-1);
  // From another page's clips to this page's key there is no response time.
  const since = (start: number | undefined): number | null =>
    start === undefined || isFromBefore(showings) ? null : Math.round((answered_at_ms - start) * 100) / 100;
  const given = {
    winner,
    arrangement,
    rt: since(last?.drawn.at(-1)?.[1] ?? last?.ended_at_ms),
    rt_from_first_frame: since(last?.drawn[0]?.[1]),
    time_elapsed: session.clock.elapsed(),
  };
  const playback = playbackRecord(trial.clips[0]?.clip_sha256 ?? null, showings, session.screen.record());
  return comparisonBody(trial, play, given, { ...playback, clips: clipsOf(trial, shown) });
}

/** Presses start, then the second clip, then whatever goes on. */
function actTrial(display: HTMLElement): void {
  const own = display.firstElementChild;
  const timer = setInterval(() => {
    if (!own?.isConnected) return clearInterval(timer);
    const press =
      display.querySelector<HTMLButtonElement>(".pair-answer[data-answer=right]") ?? display.querySelector<HTMLButtonElement>(".primary");
    press?.click();
  }, 250);
}
