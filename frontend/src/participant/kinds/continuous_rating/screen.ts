/** The continuous rating: ready, then the clip at actual size with the slider below it. The trace is kept before it ends. */
import type { TrialInfo } from "../../../api/schema";
import { BOOL, INT, plugin, type PluginClass, OBJECT, pressWhile, trial } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import type { Session, RatingBody, TrialKind } from "../../session";
import { beginView } from "../../views/ledger";
import { saveRating } from "../../trials/rating";
import { unlessBroken, procedureFeedback, PARAMETERS, type TrialParameters, prepareClip, release, parametersOf } from "../../trials/trial";
import { showOnce, waitForStart, clipSize, showStage, type Stage } from "../../trials/showing";
import { continuousBody, type ContinuousData, declaredContinuous } from "./answer";
import { stepFrames, traceOf, makeTrack } from "./track";
import { loadModule } from "../../../ui/load-module";

function continuousRating(session: Session): PluginClass<TrialParameters> {
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
  // Begun before the slider is put in place: the layout of both is one, before the first frame.
  const shown = showOnce(session, stage, sha256, key_at_ms, 0, ledger.kept);
  stage.below.replaceChildren(...track.parts);
  track.focus();
  try {
    const showing = await ledger.unlessBroken(shown);
    // The answer does not wait for it: what the page does next is not on the disk's time.
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
function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = { ...playbackRecord(trial.clip_sha256, [], session.screen.record()), frames_missing: trial.frames ?? 0 };
  return continuousBody(session, trial, play, {}, playback);
}

// The continuous rating as the registry of trial kinds finds it.

/** The code that draws checks loads during the first trial, which does not wait for it. It is here before a check. */
function continuousCheck(session: Session): PluginClass<{ trial: TrialInfo }> {
  const loaded = loadModule(() => import("./attention-check"));
  return plugin<{ trial: TrialInfo }, { chosen: number }>({
    name: "continuous-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { chosen: INT }, // the answer given
    show: async (display, parameters) => (await loaded).check(session, display, parameters.trial),
    async simulate(parameters) {
      const chosen = Number(/\*\*(\d+)\*\*/.exec(parameters.trial.prompt ?? "")?.[1] ?? "1");
      await (await loaded).store(session, parameters.trial, chosen, 0);
      return { chosen };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

export const kind: TrialKind = {
  node: (session, what) => trial(continuousRating(session), parametersOf(session, what)),
  attention: (session, what) => trial(continuousCheck(session), { trial: () => what().trial }),
  unrated,
};
