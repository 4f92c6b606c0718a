/** A trial of an adaptive series: ready, one clip or two in turn, then which answer. */
import type { TrialClip, TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { BOOL, FLOAT, INT, OBJECT, plugin, STRING, type PluginClass } from "../../jspsych";
import { ClipBroken } from "../../playback/player";
import { playbackRecord } from "../../playback/record";
import { clipHeight, clipWidth } from "../../screen/size";
import { sourcesOf } from "../../screens/preload";
import { stopButton } from "../../screens/support";
import type { Session } from "../../session";
import type { RatingBody } from "../rating";
import { saveRating } from "../save-rating";
import type { Chosen } from "../shared/ask-answer";
import { showBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { begin } from "../shared/next-trials";
import { clipsOf } from "../shared/roles";
import { showOnce, type Shown, waitForStart } from "../shared/showing";
import { stage, type Stage } from "../shared/stage";
import { sayAlreadySeen } from "../shared/already-seen";
import { beginView, isFromBefore, viewsBefore } from "../../views/ledger";
import { askResponse, type Response } from "./answers";
import { awaitChoice } from "./await-choice";
import { thresholdBody } from "./body";
import { declaredThreshold } from "./declared";

export interface ThresholdParameters {
  trial: TrialInfo;
  play: number;
  next: TrialInfo | null;
  number: number;
  total: number;
}
export interface ThresholdData {
  chosen: string | null;
  rt: number | null;
  again: boolean;
}
interface RoleShown {
  roles: string[];
  showing: Shown;
}

export function thresholdTrial(session: Session): PluginClass<ThresholdParameters> {
  return plugin<ThresholdParameters, ThresholdData>({
    name: "threshold",
    parameters: {
      trial: { type: OBJECT, description: "the assigned trial" },
      play: { type: INT, description: "1, or more where a failed trial is shown again" },
      next: { type: OBJECT, description: "the trial after this one" },
      number: { type: INT, description: "place of this trial among those counted, from 1" },
      total: { type: INT, description: "how many there are at most" },
    },
    data: {
      chosen: { type: STRING, description: "the answer; null where the clips could not be shown" },
      rt: { type: FLOAT, description: "from the last frame to the answer, ms" },
      again: { type: BOOL, description: "true where this was a repetition" },
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: async (parameters) => (await import("./simulate")).simulatedThreshold(session, parameters),
    act: actTrial,
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: ThresholdParameters): Promise<ThresholdData> {
  const { trial, play, next } = parameters;
  await awaitChoice(session, display, trial);
  begin(trial);
  const body = await watchAndAnswer(session, display, parameters).catch(async (error: unknown) => {
    if (!(error instanceof ClipBroken)) throw error;
    session.events.add("clip_unavailable", { clip_sha256: trial.clip_sha256, reason: error.message });
    await showBroken(session, display);
    return unrated(session, trial, play);
  });
  await saveRating(session, trial, body);
  const kept = new Set(next?.clips.map(({ clip_sha256 }) => clip_sha256));
  for (const { clip_sha256 } of trial.clips) if (!kept.has(clip_sha256)) session.player.release(clip_sha256);
  const chosen = body.answer.kind === "threshold" ? body.answer.chosen : null;
  return { chosen, rt: body.rt, again: play > 1 };
}

/** What is stored of a play without an answer. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const given = { chosen: null, rt: null, rt_from_first_frame: null, time_elapsed: session.clock.elapsed() };
  return thresholdBody(trial, play, given, playbackRecord(null, [], session.screen.record()));
}

function placeFor(session: Session, display: HTMLElement, trial: TrialInfo): Stage {
  const wanted = clipWidth(trial, session.run.display.inter_ocular_mm, session.screen.px_per_mm);
  // Only where calibration is optional can it be too wide: it is then as wide as the window.
  const width = Math.min(wanted, window.innerWidth);
  const name = session.t(trial.clips.length > 1 ? "pair_name" : "clip_name");
  const place = stage(session.player.element, width, clipHeight(trial, width), name);
  place.element.append(stopButton(session));
  display.replaceChildren(place.element);
  return place;
}

async function watchAndAnswer(session: Session, display: HTMLElement, parameters: ThresholdParameters): Promise<RatingBody> {
  const { trial, play } = parameters;
  const declared = declaredThreshold(session);
  const place = placeFor(session, display, trial);
  const before = viewsBefore(trial, play).at(-1);
  if (before) sayAlreadySeen(session, place);
  const shown = before ?? (await watch(session, place, parameters));
  const question = h("h1", { class: "question" }, pick(declared.question, session.language));
  const answered = await askResponse(session, place.below, question);
  const body = bodyOf(session, parameters, shown, answered);
  const showings = shown.map(({ showing }) => showing);
  if (trial.kind === "practice") await procedureFeedback(session, place, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
}

async function watch(session: Session, place: Stage, parameters: ThresholdParameters): Promise<RoleShown[]> {
  const { trial, play } = parameters;
  const declared = declaredThreshold(session);
  await prepare(session, trial);
  const key_at_ms = await waitForStart(session, place, readyText(session, trial), note(session, parameters), declared.pointer_delay_ms);
  const ledger = beginView(session, trial, play);
  const shown = await ledger.unlessBroken(showInTurn(session, place, trial, key_at_ms, ledger.kept));
  void ledger.end(shown);
  return shown;
}

/** Fetch and decode every clip, and blank the first one's place. Throws ClipBroken. */
async function prepare(session: Session, trial: TrialInfo): Promise<void> {
  try {
    await Promise.all(trial.clips.map((clip) => decoded(session, trial, clip)));
    const first = trial.clips[0];
    if (first) session.player.blank(first.clip_sha256);
  } catch (error) {
    throw error instanceof ClipBroken ? error : new ClipBroken(String(error));
  }
}

async function decoded(session: Session, trial: TrialInfo, { clip_sha256, fps }: TrialClip): Promise<void> {
  if (!session.clips.get(clip_sha256)) await session.clips.load(sourcesOf([trial]));
  const bytes = session.clips.get(clip_sha256);
  if (!bytes) throw new ClipBroken("the clip could not be loaded");
  await session.player.prepare(clip_sha256, bytes, fps);
}

async function showInTurn(session: Session, place: Stage, trial: TrialInfo, key_at_ms: number, kept: Promise<void>): Promise<RoleShown[]> {
  const { gap_ms } = declaredThreshold(session);
  const shown: RoleShown[] = [];
  for (const { role, clip_sha256 } of trial.clips) {
    if (shown.length > 0) {
      place.setPlaying(true);
      session.player.blank(clip_sha256);
      await new Promise((resolve) => setTimeout(resolve, gap_ms));
    }
    const showing = await showOnce(session, place, clip_sha256, key_at_ms, 0, kept);
    if (showing.focus_lost > 0) session.events.add("focus_lost", { trial_index: trial.trial_index });
    shown.push({ roles: [role], showing });
  }
  return shown;
}

function readyText({ t }: Session, trial: TrialInfo): string {
  const touch = matchMedia("(pointer: coarse)").matches;
  if (trial.clips.length > 1) return t(touch ? "pair_ready_touch" : "pair_ready");
  return t(touch ? "ready_touch" : "ready");
}

function note({ t }: Session, { play, trial, number, total }: ThresholdParameters): string {
  if (play > 1 && trial.kind !== "practice") return t(trial.clips.length > 1 ? "pair_replay" : "ready_replay");
  return t(trial.kind === "practice" ? "practice_note" : "trial_of", { number, total });
}

function bodyOf(session: Session, { trial, play }: ThresholdParameters, shown: RoleShown[], chosen: Chosen<Response>): RatingBody {
  const showings = shown.map(({ showing }) => showing);
  const last = showings.at(-1);
  const since = (start: number | undefined): number | null =>
    start === undefined || isFromBefore(showings) ? null : Math.round((chosen.answered_at_ms - start) * 100) / 100;
  const given = {
    chosen: chosen.name,
    rt: since(last?.drawn.at(-1)?.[1] ?? last?.ended_at_ms),
    rt_from_first_frame: since(last?.drawn[0]?.[1]),
    time_elapsed: session.clock.elapsed(),
  };
  const playback = playbackRecord(trial.clip_sha256, showings, session.screen.record());
  const clips = trial.clips.length > 1 ? clipsOf(trial, shown) : null;
  return thresholdBody(trial, play, given, { ...playback, clips });
}

/** Presses start, then the second answer, then whatever goes on. */
function actTrial(display: HTMLElement): void {
  const own = display.firstElementChild;
  const timer = setInterval(() => {
    if (!own?.isConnected) return clearInterval(timer);
    const press = [...display.querySelectorAll<HTMLButtonElement>(".pair-answer")].at(-1);
    (press ?? display.querySelector<HTMLButtonElement>(".primary"))?.click();
  }, 250);
}
