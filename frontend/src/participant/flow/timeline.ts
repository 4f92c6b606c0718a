/** The visit as a jsPsych timeline: what is left of it, in order. */
import { type Session, type Stage, counted, done, isDone } from "../session";
import type { TrialInfo, Form } from "../../api/schema";
import { trial, type Node } from "../jspsych";
import { blockBreak, loadRest, textPage, consent } from "../screens/text-page";
import { calibration, loadCalibration, needsScreenSetup, screenSetup } from "../screens/screen-setup";
import { preloadPage, sourcesOf, settle } from "../screens/preload";
import { trialNode } from "../kinds";
import { finish } from "../screens/finish";
import { formPage } from "../screens/form";
import { codeNote } from "../screens/support";

// Reports the participant's progress to the server, once per stage.

function enterStage(session: Session, stage: Stage): void {
  if (session.run.stage === stage) return;
  session.run.stage = stage;
  void session.api.stage(stage);
}

// Practice and blocks: clips fetched first, trials in the stored order, failed clips again at the end.

const RECEIPTS_WITHIN_MS = 10_000;
/** Trials of a block whose clips are here before it begins; a trial lasts longer than the next clip takes to come. */
const CLIPS_FIRST = 3;
const PRACTICE = 0;

/** What is shown first is fetched while consent and questions are read; what fails is fetched again in its turn. */
export function fetchFirst(session: Session): void {
  void loadRest().catch(() => {});
  if (session.run.display.calibrate !== "off") void loadCalibration().catch(() => {});
  const open = session.run.trials.filter((one) => !one.answered);
  const first = open.find((one) => one.kind !== "practice")?.block;
  // Practice is of block 0, and comes first in the run's order.
  void session.clips.load(sourcesOf(open.filter((one) => one.kind === "practice" || one.block === first)));
}

function practiceNodes(session: Session): Node[] {
  const { run, t } = session;
  const trials = run.trials.filter((one) => one.kind === "practice" && !one.answered);
  if (trials.length === 0) return [];
  const head = run.blocks[0];
  const first = head?.block ?? null;
  const text = run.texts.practice || `# ${t("practice_title")}\n\n${t("practice_ahead", { trials: trials.length })}`;
  const total = counted(run).length;
  const remarks = [t("practice_done", { trials: total })];
  if (head && run.blocks.length > 1) remarks.push(t("practice_parts", { block: head.trials }));
  return [
    trial(textPage(session), { eyebrow: "", text, action: t("continue"), remarks: "" }),
    {
      timeline: trialNodes(session, trials, [onceMore(session, PRACTICE)]),
      on_timeline_start: () => {
        enterStage(session, "practice");
        fetchAhead(session, trials, first);
      },
    },
    trial(textPage(session), { eyebrow: "", text: `# ${t("practice_done_title")}`, action: t("start_study"), remarks: remarks.join(" ") }),
  ];
}

function restNodes(session: Session, block: number): Node[] {
  const { blocks, break_seconds_min, display } = session.run;
  const looksAgain: Node = {
    timeline: [trial(calibration(session), { eyebrow: "", occasion: "recheck" })],
    conditional_function: () => display.recheck_size && session.screen.calibration !== null,
  };
  return [trial(blockBreak(session), { block, blocks: blocks.length, seconds_min: break_seconds_min }), looksAgain];
}

function blockNodes(session: Session, block: number, next: number | null): Node[] {
  const trials = trialsOf(session, block);
  const open = trials.filter((one) => !one.answered && one.plays_done === 0);
  return [
    {
      timeline: [...trialNodes(session, open), ...repetitions(session, block)],
      on_timeline_start: () => {
        enterStage(session, "trials");
        fetchAhead(session, trials, next);
      },
    },
  ];
}

function trialsOf({ run }: Session, block: number): TrialInfo[] {
  return run.trials.filter((one) => one.block === block && one.kind !== "practice");
}

/** A block begins when its first clips are here; the others come while these are shown, and are waited for in their turn. */
function preloadNode(session: Session, trials: TrialInfo[]): Node {
  return {
    timeline: [trial(preloadPage(session), { eyebrow: "", trials })],
    conditional_function: () => !session.clips.hasAll(sourcesOf(trials)),
  };
}

function fetchAhead(session: Session, trials: TrialInfo[], next: number | null): void {
  const now = sourcesOf(trials);
  const ahead = next === null ? [] : sourcesOf(trialsOf(session, next));
  session.clips.keepOnly([...now, ...ahead]);
  // After the clips that are needed now; what fails here is fetched again, and shown, when its turn comes.
  void session.clips.load(now).then(() => session.clips.load(ahead));
}

function trialNodes(session: Session, trials: TrialInfo[], after: Node[] = []): Node[] {
  return trials.flatMap((one, index) => {
    const next = trials[index + 1] ?? null;
    const node = trialNode(session, one.kind, () => ({ trial: one, play: 1, next }));
    // An adaptive series may have ended before this trial has its turn.
    const clips = preloadNode(session, trials.slice(index, index + (index === 0 ? CLIPS_FIRST : 1)));
    return [{ timeline: [...checks(session), clips, node, ...after], conditional_function: () => !one.answered }];
  });
}

/** Before a trial: full screen, room and size as they were, or put right first; then a word of warning that waits. */
function checks(session: Session): Node[] {
  const { screen, api, run, warnings, events } = session;
  const setup: Node = {
    timeline: [trial(screenSetup(session), { eyebrow: "", again: true })],
    conditional_function: () => needsScreenSetup(session),
  };
  const measure: Node = {
    timeline: [trial(calibration(session), { eyebrow: "", occasion: "screen_changed" })],
    conditional_function: () => {
      const change = screen.change();
      const calibrated = change === "zoom" ? screen.afterZoom() : null;
      if (calibrated) void api.calibration(calibrated);
      return run.display.calibrate !== "off" && change === "screen";
    },
  };
  const read: Node = { timeline: [], on_timeline_start: () => events.add("warning_shown", { rule: warnings.shift()?.rule }) };
  const warned: Node = {
    timeline: [
      trial(textPage(session), { eyebrow: "", text: () => warnings[0]?.text ?? "", action: session.t("continue"), remarks: "" }),
      read,
    ],
    conditional_function: () => warnings.length > 0,
  };
  return [setup, measure, warned];
}

function repetitions(session: Session, block: number): Node[] {
  const waits = trial(settle(session), { limit_ms: RECEIPTS_WITHIN_MS });
  return [waits, onceMore(session, block, [waits])];
}

/** What waits to be shown again, as long as something does; `after` each of them. */
function onceMore(session: Session, block: number, after: Node[] = []): Node {
  const replayDue = (): boolean => session.replays.peek(block) !== null;
  const again = trialNode(session, "main", () => {
    const next = session.replays.peek(block);
    if (!next) throw new Error("expected a clip to show again, found none");
    return { ...next, next: null };
  });
  const taken: Node = { timeline: [], on_timeline_start: () => session.replays.shift(block) };
  const waited = (): TrialInfo[] => [session.replays.peek(block)?.trial].filter((one) => one !== undefined);
  const clips: Node = {
    timeline: [trial(preloadPage(session), { eyebrow: "", trials: waited })],
    conditional_function: () => !session.clips.hasAll(sourcesOf(waited())),
  };
  return { timeline: [...checks(session), clips, again, taken, ...after], conditional_function: replayDue, loop_function: replayDue };
}

/** The whole visit; where an answer is to decide which clips there are, no further than that answer. */
export function timeline(session: Session, token: string): Node[] {
  if (session.run.awaits_group) return beginning(session);
  const steps = [...beginning(session), ...middle(session), ...ending(session)];
  return [...steps, trial(finish(session), { token })];
}

/** Consent, questions and the screen, whichever of them is still to do. */
function beginning(session: Session): Node[] {
  const { run, t } = session;
  const steps: ((eyebrow: string) => Node)[] = [];
  if (!run.consented_at) steps.push((eyebrow) => stageNode(session, "consent", trial(consent(session), { eyebrow })));
  for (const form of openForms(session, "before")) {
    steps.push((eyebrow) => stageNode(session, "forms_before", trial(formPage(session), { eyebrow, form })));
  }
  if (trialsLeft(session)) {
    // Only where it will show something: steps that are counted and never come read as a fault. A window made smaller
    // later is put right before the first trial.
    if (needsScreenSetup(session) || needsSize(session)) steps.push((eyebrow) => screenNode(session, eyebrow));
    steps.push((eyebrow) => stageNode(session, "instructions", introduction(session, eyebrow)));
  }
  const before = stepsDone(session);
  const total = before + steps.length;
  return steps.map((make, index) => make(t("step", { step: before + index + 1, steps: total })));
}

/** Steps that this visit had before the page was loaded again: they keep their numbers. */
function stepsDone(session: Session): number {
  const { run, screen } = session;
  if (!run.consented_at) return 0;
  const forms = run.forms.filter(({ name, when }) => when === "before" && run.answered_forms.includes(name)).length;
  const isMeasured = run.display.calibrate !== "off" && screen.calibration !== null && !needsScreenSetup(session);
  return 1 + forms + Number(isMeasured);
}

const needsSize = ({ run, screen }: Session): boolean => run.display.calibrate !== "off" && screen.calibration === null;

function screenNode(session: Session, eyebrow: string): Node {
  const setup: Node = {
    timeline: [trial(screenSetup(session), { eyebrow, again: false })],
    conditional_function: () => needsScreenSetup(session),
  };
  const measure: Node = {
    timeline: [trial(calibration(session), { eyebrow, occasion: "first" })],
    conditional_function: () => needsSize(session),
  };
  return stageNode(session, "calibration", { timeline: [setup, measure] });
}

/** The instructions at first; on a later visit a word of welcome before them. */
function introduction(session: Session, eyebrow: string): Node {
  const { run, t } = session;
  const trials = counted(run);
  const back = trials.some((one) => one.answered);
  const welcome = `# ${t("welcome_back_title")}\n\n${t("welcome_back", { done: done(run).length, total: trials.length })}\n\n`;
  const text = back ? welcome + run.texts.instructions.replace(/^(\s*)# /, "$1## ") : run.texts.instructions;
  return trial(textPage(session), { eyebrow, text, action: t("continue"), remarks: codeNote(session) });
}

function middle(session: Session): Node[] {
  const practice = practiceNodes(session);
  const open = session.run.blocks.filter(({ block }) => blockIsOpen(session, block));
  const blocks = open.flatMap(({ block }, index): Node[] => [
    ...(index > 0 ? restNodes(session, block) : []),
    ...blockNodes(session, block, open[index + 1]?.block ?? null),
  ]);
  return [...practice, ...blocks];
}

function blockIsOpen(session: Session, block: number): boolean {
  return counted(session.run).some((one) => one.block === block && !isDone(one));
}

function ending(session: Session): Node[] {
  return openForms(session, "after").map((form) => stageNode(session, "forms_after", trial(formPage(session), { eyebrow: "", form })));
}

function openForms({ run }: Session, when: Form["when"]): Form[] {
  return run.forms.filter((form) => form.when === when && !run.answered_forms.includes(form.name));
}

function trialsLeft({ run }: Session): boolean {
  return !run.trials.every(isDone);
}

function stageNode(session: Session, stage: Parameters<typeof enterStage>[1], node: Node): Node {
  return { timeline: [node], on_timeline_start: () => enterStage(session, stage) };
}
