/** A motion check: ready, its clip at actual size, then which of the choices; or the other way, where one is offered. */
import type { CheckAnswer, TrialInfo, ShownCheck } from "../../../api/schema";
import { playbackRecord, type PlaybackRecord } from "../../playback/record";
import type { Session, RatingBody, TrialKind } from "../../session";
import { ratingBody, saveRating } from "../../trials/rating";
import { h, button, showPage } from "../../../ui/element";
import { markdown } from "../../../ui/markdown";
import { choose, screenSignal, stopButton } from "../../screens/support";
import { beginView, spanOf, timesOf, viewsBefore } from "../../views/ledger";
import { sayAlreadySeen, showOnce, type Shown, waitForStart, clipSize, showStage, type Stage } from "../../trials/showing";
import { askAnswer, type Chosen } from "../../trials/answers";
import { unlessBroken, numbering, prepareClip, release } from "../../trials/trial";
import { INT, OBJECT, plugin, trial, type PluginClass } from "../../jspsych";
import "../../trials/answers.css";
import "./check.css";

// What the server is sent of one motion check.

type Times = Partial<Pick<RatingBody, "rt" | "rt_from_first_frame">>;

function checkBody(
  session: Session,
  trial: TrialInfo,
  answer: Pick<CheckAnswer, "check" | "other_way">,
  playback: PlaybackRecord,
  times: Times = {},
  play = 1,
): RatingBody {
  return ratingBody(session, trial, play, { kind: "check", ...answer }, playback, times);
}

/** What is stored of a check that nobody could answer: its clip could not be shown, or its view was broken off. */
function unrated(session: Session, trial: TrialInfo, play: number): RatingBody {
  const playback = playbackRecord(null, [], session.screen.record());
  return checkBody(session, trial, { check: null, other_way: false }, playback, {}, play);
}

/** Thrown to leave the clip, or the question, for the other way. */
class OtherWayTaken extends Error {}

interface CheckData {
  check: number | null;
}
type Keyed = Record<string, number>;
const ARROWS: Keyed = { ArrowLeft: 1, ArrowRight: 2, ArrowUp: 3, ArrowDown: 4 };
const POINTER_DELAY_MS = 300;

async function showCheck(session: Session, display: HTMLElement, trial: TrialInfo): Promise<CheckData> {
  const broken = unlessBroken(session, display, trial, () => unrated(session, trial, 1));
  const body = await watchAndAnswer(session, display, trial).catch((error: unknown) =>
    error instanceof OtherWayTaken ? otherWay(session, display, trial) : broken(error),
  );
  await saveRating(session, trial, body);
  release(session, trial, null);
  return { check: body.answer.kind === "check" ? body.answer.check : null };
}

/** The words of this check. Throws where the server has sent none. */
function asked(session: Session, trial: TrialInfo): ShownCheck {
  const words = trial.check && session.run.checks?.by_kind[trial.check];
  if (!words) throw new Error(`expected the words of a check, got none for ${String(trial.check)}`);
  return words;
}

async function watchAndAnswer(session: Session, display: HTMLElement, trial: TrialInfo): Promise<RatingBody> {
  const clipStage = showStage(session, display, () => clipSize(session, trial));
  const other = way(session, clipStage);
  const before = viewsBefore(trial, 1).at(-1)?.[0]?.showing;
  if (before) sayAlreadySeen(session, clipStage);
  const shown = before ?? (await watch(session, clipStage, trial, other));
  const chosen = await Promise.race([ask(session, clipStage, trial, other.signal), other.left]);
  return bodyOf(session, trial, shown, chosen);
}

interface Way {
  /** Fails when the other way is taken. */
  left: Promise<never>;
  signal: AbortSignal;
  button: HTMLElement | null;
}

/** The quiet button of the other way, where the study offers one. */
function way(session: Session, clipStage: Stage): Way {
  const taken = new AbortController();
  const left = new Promise<never>((_, reject) => {
    taken.signal.addEventListener("abort", () => reject(new OtherWayTaken()));
  });
  // Where nobody waits for it, the browser would report a rejection that is not handled.
  left.catch(() => {});
  const offered = session.run.checks?.other_way;
  const leave = offered ? button(offered.label, () => taken.abort(), "plain") : null;
  if (leave) clipStage.element.append(h("div", { class: "other-way" }, leave));
  return { left, signal: taken.signal, button: leave };
}

async function watch(session: Session, clipStage: Stage, trial: TrialInfo, other: Way): Promise<Shown> {
  const sha256 = await prepareClip(session, trial, clipStage);
  const { t } = session;
  const touch = matchMedia("(pointer: coarse)").matches;
  const note = t("trial_of", { ...numbering(session, trial) });
  const start = waitForStart(session, clipStage, t(touch ? "ready_touch" : "ready"), note, POINTER_DELAY_MS, other.signal);
  const key_at_ms = await Promise.race([start, other.left]);
  const ledger = beginView(session, trial, 1);
  const shown = await ledger.unlessBroken(showOnce(session, clipStage, sha256, key_at_ms, 0, ledger.kept));
  // The question does not wait for it: what the page does next is not on the disk's time.
  void ledger.end([{ roles: ["shown"], showing: shown }]);
  if (shown.focus_lost > 0) session.events.add("focus_lost", { trial_index: trial.trial_index });
  return shown;
}

async function ask(session: Session, clipStage: Stage, trial: TrialInfo, left: AbortSignal): Promise<Chosen<string>> {
  const { question, choices } = asked(session, trial);
  const { signal, done } = screenSignal(session);
  // Keys must not answer any more once the other way is taken.
  left.addEventListener("abort", done);
  const chosen = await askAnswer<string>(clipStage.below, {
    choices: choices.map((label, index) => ({ name: String(index + 1), number: index + 1, label })),
    keyed: (key) => keyed(key, trial, choices.length),
    layout: trial.check === "digit" ? "digits" : "choices",
    pointer_delay_ms: POINTER_DELAY_MS,
    signal,
    question: h("h1", { class: "question" }, question),
  });
  done();
  return chosen;
}

/** A choice's number is its key; arrows point the way where the question is which way. */
function keyed(key: string, { check }: TrialInfo, choices: number): string | null {
  const number = (check === "direction" ? ARROWS[key] : undefined) ?? Number(key);
  return Number.isInteger(number) && number >= 1 && number <= choices ? String(number) : null;
}

function bodyOf(session: Session, trial: TrialInfo, shown: Shown, { name, answered_at_ms }: Chosen<string>): RatingBody {
  const times = timesOf(spanOf([shown]), answered_at_ms);
  const playback = playbackRecord(trial.clip_sha256, [shown], session.screen.record());
  return checkBody(session, trial, { check: Number(name), other_way: false }, playback, times);
}

async function otherWay(session: Session, display: HTMLElement, trial: TrialInfo): Promise<RatingBody> {
  const footer = h("footer", { class: "actions" });
  const text = session.run.checks?.other_way?.text ?? "";
  showPage(display, { body: [h("div", { class: "prose" }, ...markdown(text)), footer] }).append(stopButton(session));
  await choose(session, footer, [{ label: session.t("continue"), value: true }], "always");
  const playback = playbackRecord(null, [], session.screen.record());
  return checkBody(session, trial, { check: null, other_way: true }, playback);
}

/** What a simulated visit stores: a choice at random, with a playback of method none. */
async function simulateCheck(session: Session, trial: TrialInfo): Promise<CheckData> {
  const check = 1 + Math.floor(Math.random() * asked(session, trial).choices.length);
  const playback = playbackRecord(trial.clip_sha256, [], session.screen.record());
  await saveRating(
    session,
    trial,
    checkBody(session, trial, { check, other_way: false }, playback, { rt: 500, rt_from_first_frame: 2_500 }),
  );
  return { check };
}

/** Presses start, then the first choice, then whatever goes on. */
function actCheck(display: HTMLElement): void {
  const timer = setInterval(() => {
    const own = display.querySelector(".trial, .actions");
    if (!own) return clearInterval(timer);
    (display.querySelector<HTMLButtonElement>(".pair-answer") ?? display.querySelector<HTMLButtonElement>(".primary"))?.click();
    if (display.querySelector('.pair-answer[aria-pressed="true"]')) clearInterval(timer);
  }, 50);
}

// Motion checks of a study of any kind; loaded with the visit of a study that declares them.

interface Parameters {
  trial: TrialInfo;
}

function motionCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, CheckData>({
    name: "motion-check",
    parameters: { trial: OBJECT }, // the assigned check
    data: { check: INT }, // number of the choice; null where there is none
    show: (display, parameters) => showCheck(session, display, parameters.trial),
    simulate: (parameters) => simulateCheck(session, parameters.trial),
    act: actCheck,
  });
}

const node: TrialKind["node"] = (session, what) => trial(motionCheck(session), { trial: () => what().trial });

export const kind: TrialKind = { node, attention: node, unrated };
