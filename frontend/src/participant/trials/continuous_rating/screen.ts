/** The continuous rating: ready, then the clip at actual size with the slider below it. The trace is kept before it ends. */
import type { TrialInfo } from "../../../api/schema";
import { BOOL, INT, plugin, type PluginClass } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import type { Session } from "../../session";
import { beginView } from "../../views/ledger";
import type { RatingBody } from "../rating";
import { saveRating } from "../save-rating";
import { unlessBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { PARAMETERS, type TrialParameters } from "../shared/parameters";
import { prepareClip, release } from "../shared/prepare";
import { showOnce, waitForStart } from "../shared/showing";
import { clipSize, showStage, type Stage } from "../shared/stage";
import { continuousBody } from "./body";
import { declaredContinuous } from "./declared";
import { stepFrames, traceOf } from "./trace";
import { makeTrack } from "./track";

export interface ContinuousData {
  samples: number;
  moves: number;
  frames_missing: number | null;
  again: boolean;
}

export function continuousRating(session: Session): PluginClass<TrialParameters> {
  return plugin<TrialParameters, ContinuousData>({
    name: "continuous-rating",
    parameters: PARAMETERS,
    data: {
      samples: INT, // samples of the trace
      moves: INT, // how often the slider began to move
      frames_missing: INT, // frames never drawn
      again: BOOL, // true where this was a repetition
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: async (parameters) => (await import("./simulate")).simulatedTrace(session, parameters),
    act: async (display) => (await import("./simulate")).actTrace(display),
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: TrialParameters): Promise<ContinuousData> {
  const { trial, play, next } = parameters;
  const stage = showStage(session, display, () => clipSize(session, trial));
  const body = await watch(session, stage, parameters).catch(unlessBroken(session, display, trial, () => unrated(session, trial, play)));
  await saveRating(session, trial, body);
  release(session, trial, next);
  const values = body.answer.kind === "continuous_rating" ? (body.answer.values ?? []) : [];
  return { samples: values.length, moves: body.changes, frames_missing: body.playback.frames_missing, again: play > 1 };
}

async function watch(session: Session, stage: Stage, { trial, play, number, total }: TrialParameters): Promise<RatingBody> {
  const { t } = session;
  const declared = declaredContinuous(session);
  const sha256 = await prepareClip(session, trial, stage);
  const touch = matchMedia("(pointer: coarse)").matches;
  const note = play > 1 ? t("ready_replay") : t(trial.kind === "practice" ? "practice_note" : "trial_of", { number, total });
  const key_at_ms = await waitForStart(session, stage, t(touch ? "ready_touch" : "ready"), note, declared.pointer_delay_ms);
  const { signal, done } = screenSignal(session);
  const track = makeTrack(declared, session.language, signal);
  const ledger = beginView(session, trial, play);
  const shown = showOnce(session, stage, sha256, key_at_ms, 0, ledger.kept);
  stage.below.replaceChildren(...track.parts);
  track.focus();
  try {
    const showing = await ledger.unlessBroken(shown);
    void ledger.end([{ roles: ["shown"], showing }]);
    if (showing.focus_lost > 0) session.events.add("focus_lost", { trial_index: trial.trial_index });
    const step_frames = stepFrames(showing.fps, declared.sample_hz);
    const values = traceOf(track.moves, showing.drawn, showing.frames, showing.fps, step_frames);
    const answer = { values, step_frames, moves: track.started() };
    const body = continuousBody(session, trial, play, answer, playbackRecord(trial.clip_sha256, [showing], session.screen.record()));
    if (trial.kind === "practice") await procedureFeedback(session, stage, { trial, play, showings: [showing], rt_ms: 0 });
    return body;
  } finally {
    done();
  }
}

/** What is stored of a play without an answer. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = { ...playbackRecord(trial.clip_sha256, [], session.screen.record()), frames_missing: trial.frames ?? 0 };
  return continuousBody(session, trial, play, {}, playback);
}
