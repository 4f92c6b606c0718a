/** The visit as a jsPsych timeline: what is left of it, in order. */
import type { Form } from "../../api/schema";
import { trial, type Node } from "../jspsych";
import { calibration } from "../screens/calibration";
import { consent } from "../screens/consent";
import { finish } from "../screens/finish";
import { formPage } from "../screens/form";
import { needsScreenSetup, screenSetup } from "../screens/screen-setup";
import { textPage } from "../screens/text-page";
import { codeNote } from "../screens/support";
import { counted, done, isDone, type Session } from "../session";
import { blockNodes, practiceNodes, restNodes } from "./blocks";
import { enterStage } from "./stages";

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
