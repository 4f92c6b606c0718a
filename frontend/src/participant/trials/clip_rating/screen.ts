/** The single-clip rating: ready, the clip at actual size, then the scale. The rating is kept before it ends. */
import type { TrialInfo } from "../../../api/schema";
import type { RatingBody } from "../rating";
import { BOOL, FLOAT, INT, OBJECT, plugin, type PluginClass } from "../../jspsych";
import { ClipBroken } from "../../playback/player";
import { playbackRecord } from "../../playback/record";
import { clipHeight, clipWidth } from "../../screen/size";
import { screenSignal, stopButton } from "../../screens/support";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { showBroken } from "../shared/broken";
import { procedureFeedback } from "../shared/feedback";
import { beginView, isFromBefore, viewsBefore } from "../../views/ledger";
import { declaredRating } from "./declared";
import { prepareClip } from "./prepare";
import { answerOf, noAnswer, onlyResponse } from "./answer";
import { askInOrder, type Rated } from "./scale";
import { sayAlreadySeen } from "../shared/already-seen";
import { showOnce, type Shown, waitForStart } from "../shared/showing";
import { stage, type Stage } from "../shared/stage";

export interface ClipRatingParameters {
  trial: TrialInfo;
  play: number;
  next: TrialInfo | null;
  number: number;
  total: number;
}
export interface ClipRatingData {
  response: number | null;
  rt: number | null;
  frames_missing: number | null;
  key_to_first_frame_ms: number | null;
  again: boolean;
}

export function clipRating(session: Session): PluginClass<ClipRatingParameters> {
  return plugin<ClipRatingParameters, ClipRatingData>({
    name: "clip-rating",
    parameters: {
      trial: { type: OBJECT, description: "the assigned trial" },
      play: { type: INT, description: "1, or more where a failed clip is shown again" },
      next: { type: OBJECT, description: "the trial after this one, decoded while this one is rated" },
      number: { type: INT, description: "place of this trial among those counted, from 1" },
      total: { type: INT, description: "how many there are" },
    },
    data: {
      response: { type: INT, description: "the rating, null where the clip could not be shown" },
      rt: { type: FLOAT, description: "from the last frame to the answer, ms" },
      frames_missing: { type: INT, description: "frames never drawn" },
      key_to_first_frame_ms: { type: FLOAT, description: "from the start key to the first frame, ms" },
      again: { type: BOOL, description: "true where this was a repetition" },
    },
    show: (display, parameters) => runTrial(session, display, parameters),
    simulate: async (parameters) => (await import("./simulate")).simulatedRating(session, parameters),
    act: (display) => actTrial(display),
  });
}

async function runTrial(session: Session, display: HTMLElement, parameters: ClipRatingParameters): Promise<ClipRatingData> {
  const { trial } = parameters;
  const place = placeFor(session, display, trial);
  const body = await watchAndRate(session, place, parameters).catch(async (error: unknown) => {
    if (!(error instanceof ClipBroken)) throw error;
    session.events.add("clip_unavailable", { clip_sha256: trial.clip_sha256, reason: error.message });
    await showBroken(session, display);
    return unrated(session, trial, parameters.play);
  });
  await saveRating(session, trial, body);
  if (trial.clip_sha256 && trial.clip_sha256 !== parameters.next?.clip_sha256) session.player.release(trial.clip_sha256);
  const { frames_missing, key_to_first_frame_ms } = body.playback;
  const response = body.answer.kind === "clip_rating" ? onlyResponse(body.answer.answers) : null;
  return { response, rt: body.rt, frames_missing, key_to_first_frame_ms, again: parameters.play > 1 };
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

async function watchAndRate(session: Session, place: Stage, parameters: ClipRatingParameters): Promise<RatingBody> {
  const { trial, next, play } = parameters;
  const before = viewsBefore(trial, play).flatMap((view) => view.map(({ showing }) => showing));
  const showings = before.length < declaredRating(session).views ? await watch(session, place, parameters, before) : before;
  if (showings === before) sayAlreadySeen(session, place);
  const rating = rate(session, place);
  if (next) void prepareClip(session, next, null).catch(() => {});
  const rated = await rating;
  const body = ratingBody(session, parameters, showings, rated);
  if (trial.kind === "practice") await procedureFeedback(session, place, { trial, play, showings, rt_ms: body.rt ?? 0 });
  return body;
}

async function watch(
  session: Session,
  place: Stage,
  { number, total, play, trial }: ClipRatingParameters,
  before: Shown[],
): Promise<Shown[]> {
  const { t } = session;
  const { views, start, fixation_ms, pointer_delay_ms } = declaredRating(session);
  const sha256 = await prepareClip(session, trial, place);
  const showings = [...before];
  const key = trial.kind === "practice" ? "practice_note" : "trial_of";
  for (let view = before.length + 1; view <= views; view += 1) {
    const touch = matchMedia("(pointer: coarse)").matches;
    const first = t(touch ? "ready_touch" : "ready");
    const prompt = view > 1 ? t(touch ? "ready_again_touch" : "ready_again", { view, views }) : first;
    const note = play > 1 && trial.kind !== "practice" ? t("ready_replay") : t(key, { number, total });
    const key_at_ms = await waitForStart(session, place, prompt, note, pointer_delay_ms);
    const ledger = beginView(session, trial, play);
    const shown = showOnce(session, place, sha256, key_at_ms, start === "fixation" ? fixation_ms : 0, ledger.kept);
    const showing = await ledger.unlessBroken(shown);
    showings.push(showing);
    // The scale does not wait for it: what the page does next is not on the disk's time.
    void ledger.end([{ roles: ["shown"], showing }]);
    if (showings.some((shown) => shown.focus_lost > 0)) session.events.add("focus_lost", { trial_index: trial.trial_index });
  }
  return showings;
}

async function rate(session: Session, place: Stage): Promise<Rated> {
  const { signal, done } = screenSignal(session);
  const { language, t } = session;
  const rated = await askInOrder(place.below, declaredRating(session), { language, t, signal });
  done();
  return rated;
}

function ratingBody(session: Session, { trial, play }: ClipRatingParameters, showings: Shown[], rated: Rated): RatingBody {
  const last = showings.at(-1);
  const ended_at_ms = last?.drawn.at(-1)?.[1] ?? last?.ended_at_ms;
  // From another page's clip to this page's key there is no response time.
  const since = (start: number | undefined): number | null =>
    start === undefined || isFromBefore(showings) ? null : Math.round((rated.answered_at_ms - start) * 100) / 100;
  return {
    trial_index: trial.trial_index,
    play,
    answer: answerOf(rated, isFromBefore(showings) ? undefined : ended_at_ms),
    rt: since(ended_at_ms),
    rt_from_first_frame: since(last?.drawn[0]?.[1]),
    time_elapsed: session.clock.elapsed(),
    changes: rated.changes,
    comment: rated.comment,
    answered_at_client: new Date().toISOString(),
    playback: playbackRecord(trial.clip_sha256, showings, session.screen.record()),
  };
}

/** What is stored of a play without an answer. */
export function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  return {
    trial_index: trial.trial_index,
    play,
    answer: noAnswer(declaredRating(session)),
    rt: null,
    rt_from_first_frame: null,
    time_elapsed: session.clock.elapsed(),
    changes: 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback: { ...playbackRecord(trial.clip_sha256, [], session.screen.record()), frames_missing: trial.frames ?? 0 },
  };
}

/** Presses start, then a middle key, then whatever goes on. */
function actTrial(display: HTMLElement): void {
  const own = display.firstElementChild;
  const timer = setInterval(() => {
    if (!own?.isConnected) return clearInterval(timer);
    for (const row of display.querySelectorAll(".keys")) {
      const keys = [...row.querySelectorAll<HTMLButtonElement>(".key")];
      keys[Math.floor(keys.length / 2)]?.click();
    }
    for (const slider of display.querySelectorAll<HTMLInputElement>(".slider")) slider.click();
    display.querySelector<HTMLButtonElement>(".primary")?.click();
  }, 250);
}
