/** Practice and blocks: clips fetched first, trials in the stored order, failed clips again at the end. */
import type { TrialInfo } from "../../api/schema";
import { trial, type Node } from "../jspsych";
import { blockBreak } from "../screens/block-break";
import { calibration } from "../screens/calibration";
import { preloadPage, sourcesOf } from "../screens/preload";
import { needsScreenSetup, screenSetup } from "../screens/screen-setup";
import { settle } from "../screens/settle";
import { textPage } from "../screens/text-page";
import { counted, type Session } from "../session";
import { trialNode } from "../trials";
import { enterStage } from "./stages";

const RECEIPTS_WITHIN_MS = 10_000;

/** What is shown first is fetched while consent and questions are read; what fails is fetched again in its turn. */
export function fetchFirst(session: Session): void {
  const open = session.run.trials.filter((one) => !one.answered);
  const first = open.find((one) => one.kind !== "practice")?.block;
  // Practice is of block 0, and comes first in the run's order.
  void session.clips.load(sourcesOf(open.filter((one) => one.kind === "practice" || one.block === first)));
}

export function practiceNodes(session: Session): Node[] {
  const { run, t } = session;
  const trials = run.trials.filter((one) => one.kind === "practice" && !one.answered);
  if (trials.length === 0) return [];
  const first = run.blocks[0]?.block ?? null;
  const text = run.texts.practice || `# ${t("practice_title")}`;
  const total = counted(run).length;
  const remarks = t("practice_done", { trials: total, block: run.blocks[0]?.trials ?? total });
  return [
    trial(textPage(session), { eyebrow: "", text, action: t("continue"), remarks: "" }),
    {
      timeline: [preloadNode(session, trials), ...trialNodes(session, trials)],
      on_timeline_start: () => {
        enterStage(session, "practice");
        fetchAhead(session, trials, first);
      },
    },
    trial(textPage(session), { eyebrow: "", text: `# ${t("practice_done_title")}`, action: t("start_study"), remarks }),
  ];
}

export function restNodes(session: Session, block: number): Node[] {
  const { blocks, break_seconds_min } = session.run;
  return [trial(blockBreak(session), { block, blocks: blocks.length, seconds_min: break_seconds_min })];
}

export function blockNodes(session: Session, block: number, next: number | null): Node[] {
  const trials = trialsOf(session, block);
  const open = trials.filter((one) => !one.answered && one.plays_done === 0);
  return [
    {
      timeline: [preloadNode(session, trials), ...trialNodes(session, open), ...repetitions(session, block)],
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

/** A block keeps all its clips, since any of them may be wanted again. */
function preloadNode(session: Session, trials: TrialInfo[]): Node {
  return trial(preloadPage(session), { eyebrow: "", trials });
}

function fetchAhead(session: Session, trials: TrialInfo[], next: number | null): void {
  const now = sourcesOf(trials);
  const ahead = next === null ? [] : sourcesOf(trialsOf(session, next));
  session.clips.keepOnly([...now, ...ahead]);
  // After the clips that are needed now; what fails here is fetched again, and shown, when its turn comes.
  void session.clips.load(now).then(() => session.clips.load(ahead));
}

function trialNodes(session: Session, trials: TrialInfo[]): Node[] {
  return trials.flatMap((one, place) => {
    const next = trials[place + 1] ?? null;
    const node = trialNode(session, one.kind, () => ({ trial: one, play: 1, next }));
    // An adaptive series may have ended before this trial has its turn.
    return [{ timeline: [...checks(session), node], conditional_function: () => !one.answered }];
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
    timeline: [trial(calibration(session), { eyebrow: "", changed: true })],
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
  const wanted = (): boolean => session.replays.peek(block) !== null;
  const again = trialNode(session, "main", () => {
    const next = session.replays.peek(block);
    if (!next) throw new Error("expected a clip to show again, found none");
    return { ...next, next: null };
  });
  const taken: Node = { timeline: [], on_timeline_start: () => session.replays.shift(block) };
  const loop: Node = { timeline: [...checks(session), again, taken, waits], conditional_function: wanted, loop_function: wanted };
  return [waits, loop];
}
