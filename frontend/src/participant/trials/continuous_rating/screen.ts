/** The continuous rating: ready, then the clip at actual size with the slider below it. The trace is kept before it ends. */
import type { TrialInfo } from "../../../api/schema";
import { BOOL, INT, OBJECT, plugin, type PluginClass } from "../../jspsych";
import { ClipBroken } from "../../playback/player";
import { playbackRecord } from "../../playback/record";
import { clipHeight, clipWidth } from "../../screen/size";
import { sourcesOf } from "../../screens/preload";
import { screenSignal, stopButton } from "../../screens/support";
import type { Session } from "../../session";
import { beginView } from "../../views/ledger";
import type { RatingBody } from "../rating";
import { saveRating } from "../save-rating";
import { showBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { showOnce, waitForStart } from "../shared/showing";
import { stage, type Stage } from "../shared/stage";
import { continuousBody } from "./body";
import { declaredContinuous } from "./declared";
import { stepFrames, traceOf } from "./trace";
import { makeTrack } from "./track";

export interface ContinuousParameters {
  trial: TrialInfo;
  play: number;
  next: TrialInfo | null;
  number: number;
  total: number;
}
export interface ContinuousData {
  samples: number;
  moves: number;
  frames_missing: number | null;
  again: boolean;
}

export function continuousRating(session: Session): PluginClass<ContinuousParameters> {
  return plugin<ContinuousParameters, ContinuousData>({
    name: "continuous-rating",
    parameters: {
      trial: { type: OBJECT, description: "the assigned trial" },
      play: { type: INT, description: "1, or more where a failed clip is shown again" },
      next: { type: OBJECT, description: "the trial after this one" },
      number: { type: INT, description: "place of this trial among those counted, from 1" },
      total: { type: INT, description: "how many there are" },
    },
    data: {
      samples: { type: INT, description: "samples of the trace" },
      moves: { type: INT, description: "how often the slider began to move" },
      frames_missing: { type: INT, description: "frames never drawn" },
      again: { type: BOOL, description: "true where this was a repetition" },
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: async (parameters) => (await import("./simulate")).simulatedTrace(session, parameters),
    act: (display) => {
      const timer = setInterval(() => {
        if (!display.querySelector(".trial")) return clearInterval(timer);
        display.querySelector<HTMLButtonElement>(".primary")?.click();
      }, 250);
    },
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: ContinuousParameters): Promise<ContinuousData> {
  const { trial, play, next } = parameters;
  const place = placeFor(session, display, trial);
  const body = await watch(session, place, parameters).catch(async (error: unknown) => {
    if (!(error instanceof ClipBroken)) throw error;
    session.events.add("clip_unavailable", { clip_sha256: trial.clip_sha256, reason: error.message });
    await showBroken(session, display);
    return unrated(session, trial, play);
  });
  await saveRating(session, trial, body);
  if (trial.clip_sha256 && trial.clip_sha256 !== next?.clip_sha256) session.player.release(trial.clip_sha256);
  const values = body.answer.kind === "continuous_rating" ? (body.answer.values ?? []) : [];
  return { samples: values.length, moves: body.changes, frames_missing: body.playback.frames_missing, again: play > 1 };
}

function placeFor(session: Session, display: HTMLElement, trial: TrialInfo): Stage {
  const wanted = clipWidth(trial, session.run.display.inter_ocular_mm, session.screen.px_per_mm);
  // Only where calibration is optional can it be too wide: it is then as wide as the window.
  const width = Math.min(wanted, window.innerWidth);
  const place = stage(session.player.element, width, clipHeight(trial, width), session.t("clip_name"));
  place.element.append(stopButton(session));
  display.replaceChildren(place.element);
  return place;
}

async function watch(session: Session, place: Stage, { trial, play, number, total }: ContinuousParameters): Promise<RatingBody> {
  const { t } = session;
  const declared = declaredContinuous(session);
  const sha256 = await prepared(session, trial);
  session.player.blank(sha256);
  const touch = matchMedia("(pointer: coarse)").matches;
  const note = play > 1 ? t("ready_replay") : t(trial.kind === "practice" ? "practice_note" : "trial_of", { number, total });
  const key_at_ms = await waitForStart(session, place, t(touch ? "ready_touch" : "ready"), note, declared.pointer_delay_ms);
  const { signal, done } = screenSignal(session);
  const track = makeTrack(declared, session.language, signal);
  const ledger = beginView(session, trial, play);
  const shown = showOnce(session, place, sha256, key_at_ms, 0, ledger.kept);
  place.below.replaceChildren(...track.parts);
  track.focus();
  try {
    const showing = await ledger.unlessBroken(shown);
    void ledger.end([{ roles: ["shown"], showing }]);
    if (showing.focus_lost > 0) session.events.add("focus_lost", { trial_index: trial.trial_index });
    const step_frames = stepFrames(showing.fps, declared.sample_hz);
    const values = traceOf(track.moves, showing.drawn, showing.frames, showing.fps, step_frames);
    const answer = { values, step_frames, moves: track.started() };
    const body = continuousBody(session, trial, play, answer, playbackRecord(trial.clip_sha256, [showing], session.screen.record()));
    if (trial.kind === "practice") await procedureFeedback(session, place, { trial, play, showings: [showing], rt_ms: 0 });
    return body;
  } finally {
    done();
  }
}

async function prepared(session: Session, trial: TrialInfo): Promise<string> {
  const sha256 = trial.clip_sha256 ?? "";
  if (!session.clips.get(sha256)) await session.clips.load(sourcesOf([trial]));
  const bytes = session.clips.get(sha256);
  if (!bytes) throw new ClipBroken("the clip could not be loaded");
  await session.player.prepare(sha256, bytes, trial.fps);
  return sha256;
}

/** What is stored of a play without an answer. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = { ...playbackRecord(trial.clip_sha256, [], session.screen.record()), frames_missing: trial.frames ?? 0 };
  return continuousBody(session, trial, play, {}, playback);
}
