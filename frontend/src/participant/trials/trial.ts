/** What a trial of any kind needs: its parameters, its clips made ready, and what is said where one is broken. */
import type { TrialInfo } from "../../api/schema";
import { INT, OBJECT } from "../jspsych";
import { counted, type Session, type Showable, type RatingBody } from "../session";
import { h, showPage } from "../../ui/element";
import { ClipBroken } from "../playback/protocol";
import { sourcesOf } from "../screens/preload";
import type { Stage, Shown } from "./showing";
import { choose } from "../screens/support";
import type { MessageKey } from "../../i18n";

// What the screen of a trial is given, whatever its kind: the trial, its play, and which it is among those of its part.

export interface TrialParameters extends Showable {
  number: number;
  total: number;
}

export const PARAMETERS = {
  trial: OBJECT, // the assigned trial
  play: INT, // 1, or more for a repetition
  next: OBJECT, // the trial after this one
  number: INT, // its place among those counted
  total: INT, // how many those are at most
};

/** The parameters as functions, asked when the trial's turn comes. */
export function parametersOf(session: Session, what: () => Showable) {
  return {
    trial: () => what().trial,
    play: () => what().play,
    next: () => what().next,
    number: () => numbering(session, what().trial).number,
    total: () => numbering(session, what().trial).total,
  };
}

/** Which trial this is among those of its part, for the participant. */
export function numbering(session: Session, trial: TrialInfo): { number: number; total: number } {
  const kind = trial.kind === "practice" ? session.run.trials.filter((one) => one.kind === "practice") : counted(session.run);
  return { number: kind.findIndex((one) => one.trial_index === trial.trial_index) + 1, total: kind.length };
}

// Clips made ready to start at once: their bytes are here, they are decoded, and the stage has their size.

const SOON_MS = 150;

/** What `make` gives; meanwhile the place says, where it takes long, what is waited for. Whatever fails is a ClipBroken. */
export async function whileDecoding<Made>(session: Session, stage: Stage | null, make: () => Promise<Made>): Promise<Made> {
  // Only where it takes long: a word that flashes up for a moment draws the eye.
  const say = setTimeout(() => stage?.below.replaceChildren(h("p", { role: "status" }, session.t("decoding"))), SOON_MS);
  try {
    return await make();
  } catch (error) {
    throw error instanceof ClipBroken ? error : new ClipBroken(String(error));
  } finally {
    clearTimeout(say);
  }
}

/** Decode one clip of a trial, fetched where it is not here. Throws ClipBroken where it cannot be had. */
async function decodeClip(session: Session, trial: TrialInfo, sha256: string, fps: TrialInfo["fps"]): Promise<void> {
  // The preload may have gone on without this clip (`giveUp`).
  if (!session.clips.get(sha256)) await session.clips.load(sourcesOf([trial]));
  const bytes = session.clips.get(sha256);
  if (!bytes) throw new ClipBroken("the clip could not be loaded");
  await session.player.prepare(sha256, bytes, fps);
}

/** The one clip of a trial; decoded ahead with `stage` null; a stage that is there is blanked for it too. */
export function prepareClip(session: Session, trial: TrialInfo, stage: Stage | null): Promise<string> {
  return whileDecoding(session, stage, async () => {
    const sha256 = trial.clip_sha256 ?? "";
    await decodeClip(session, trial, sha256, trial.fps);
    if (stage) session.player.blank(sha256);
    return sha256;
  });
}

/** Forget the pictures of a trial's clips; those that the next trial shows again stay decoded. */
export function release({ player }: Session, trial: TrialInfo, next: TrialInfo | null): void {
  const kept = next ? hashesOf(next) : [];
  for (const sha256 of hashesOf(trial)) if (!kept.includes(sha256)) player.release(sha256);
}

function hashesOf(trial: TrialInfo): string[] {
  return sourcesOf([trial]).map(({ clip_sha256 }) => clip_sha256);
}

// Trials that show several clips need all of them before the first begins.

/** Decode every clip of a trial. Throws ClipBroken where one cannot be had. */
export async function decodeAll(session: Session, trial: TrialInfo): Promise<void> {
  await Promise.all(trial.clips.map(({ clip_sha256, fps }) => decodeClip(session, trial, clip_sha256, fps)));
}

// Says that a clip cannot be shown, and goes on.

const READ_MS = 1_000;

/** For `catch` of a trial: if its clip could not be shown, the participant gets a message, and the play has no answer. */
export function unlessBroken(session: Session, display: HTMLElement, trial: TrialInfo, unrated: () => RatingBody) {
  return async (error: unknown): Promise<RatingBody> => {
    if (!(error instanceof ClipBroken)) throw error;
    session.events.add("clip_unavailable", { clip_sha256: trial.clip_sha256, clips: hashesOf(trial), reason: error.message });
    const footer = h("footer", { class: "actions" });
    const text = h("p", { role: "alert" }, session.t("clip_broken"));
    showPage(display, { title: session.t("clip_broken_title"), body: [text, footer] });
    // As long as the server expects a play to take for which nothing was rated (TRIED_MS): time to read it.
    await new Promise((resolve) => setTimeout(resolve, READ_MS));
    await choose(session, footer, [{ label: session.t("continue"), value: true }], "never");
    return unrated();
  };
}

// After a practice trial: a word about the procedure, never about the answer.

const SLOW_MS = 8_000;

function procedureRemark(showings: Shown[], rt_ms: number): MessageKey {
  if (showings.some((shown) => shown.focus_lost > 0)) return "feedback_focus";
  if (showings.some((shown) => shown.early_keys > 0)) return "feedback_key";
  return rt_ms > SLOW_MS ? "feedback_slow" : "feedback_good";
}

/** The procedure of these showings is to be tried once more, as long as the trial may be shown again. */
const AGAIN: MessageKey[] = ["feedback_focus", "feedback_key"];

export interface Practised {
  trial: TrialInfo;
  play: number;
  showings: Shown[];
  rt_ms: number;
}

/** Say how the procedure went; where it went wrong the same trial comes once more. */
export async function procedureFeedback(session: Session, stage: Stage, { trial, play, showings, rt_ms }: Practised): Promise<void> {
  const { t, run, replays } = session;
  const footer = h("div", { class: "actions" });
  const key = procedureRemark(showings, rt_ms);
  const again = AGAIN.includes(key) && play <= run.playback.max_repeats;
  const text = t(key, { seconds: Math.round(rt_ms / 1000) }) + (again ? ` ${t("feedback_again")}` : "");
  // What was there was about the answer that has been given.
  stage.element.querySelector(".above")?.replaceChildren();
  stage.below.replaceChildren(h("h1", { class: "feedback" }, h("span", { role: "status" }, text)), footer);
  await choose(session, footer, [{ label: t(again ? "try_again" : "continue"), value: true }], "always");
  if (again) replays.add(trial, play + 1);
}
