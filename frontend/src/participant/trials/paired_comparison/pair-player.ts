/** Two clips made ready on one canvas, and shown: at once by one clock, or in turn with the declared gap. */
import type { TrialClip, TrialInfo } from "../../../api/schema";
import { pick } from "../../../i18n";
import { ClipBroken, type Part } from "../../playback/player";
import type { Session } from "../../session";
import { release, whileDecoding } from "../shared/prepare";
import { decodeAll } from "../shared/decode-all";
import { showOnce } from "../shared/showing";
import type { Stage } from "../shared/stage";
import type { RolesShown } from "../../views/ledger";
import { declaredPairs } from "./declared";
import type { Layout, ClipBox } from "./layout";

/** One step of a trial: what the canvas shows, and for how long it stays plain before. */
interface Step {
  id: string;
  roles: string[];
  gap_ms: number;
  label: string;
}

/** Fetch, decode and compose everything the trial shows. Throws ClipBroken. */
export function preparePair(session: Session, trial: TrialInfo, layout: Layout, stage: Stage): Promise<Step[]> {
  return whileDecoding(session, stage, async () => {
    await decodeAll(session, trial);
    const steps = await Promise.all(planned(session, trial, layout).map(({ step, parts }) => composed(session, layout, step, parts)));
    const first = steps[0];
    if (first) session.player.blank(first.id);
    return steps;
  });
}

function planned(session: Session, trial: TrialInfo, layout: Layout): { step: Step; parts: Part[] }[] {
  const { presentation, reference } = declaredPairs(session);
  const named = (role: string): TrialClip[] => trial.clips.filter((clip) => clip.role === role);
  const part = (clip: TrialClip, at: ClipBox): Part => ({ sha256: clip.clip_sha256, ...at });
  const single = (clip: TrialClip, gap_ms: number, label: string): { step: Step; parts: Part[] } => ({
    step: { id: `${trial.trial_index} ${clip.role}`, roles: [clip.role], gap_ms, label },
    parts: [part(clip, layout.single)],
  });
  const before = named("reference").map((clip) => single(clip, 0, reference ? pick(reference.label, session.language) : ""));
  const after_ms = before.length && reference ? reference.gap_ms : 0;
  if (presentation.arrangement === "one_after_the_other") {
    const [first, second] = [...named("first"), ...named("second")];
    if (!first || !second) throw new ClipBroken("expected a first and a second clip");
    return [...before, single(first, after_ms, ""), single(second, presentation.gap_ms, "")];
  }
  const [left, right] = [...named("left"), ...named("right")];
  if (!left || !right) throw new ClipBroken("expected a left and a right clip");
  const step = { id: `${trial.trial_index} pair`, roles: ["left", "right"], gap_ms: after_ms, label: "" };
  return [...before, { step, parts: [part(left, layout.boxes[0]), part(right, layout.boxes[1])] }];
}

async function composed(session: Session, { canvas }: Layout, step: Step, parts: Part[]): Promise<Step> {
  await session.player.compose(step.id, parts, canvas.width, canvas.height);
  return step;
}

/** Show every step; a view's times count from the press that started it. */
export async function showAll(
  session: Session,
  stage: Stage,
  steps: Step[],
  key_at_ms: number,
  kept: Promise<void>,
): Promise<RolesShown[]> {
  const shown = [];
  for (const { id, roles, gap_ms, label } of steps) {
    if (gap_ms > 0) {
      stage.setPlaying(true);
      await new Promise((resolve) => setTimeout(resolve, gap_ms));
    }
    const showing = await showOnce(session, stage, id, key_at_ms, 0, kept, label);
    if (showing.focus_lost > 0) session.events.add("focus_lost", { roles });
    shown.push({ roles, showing });
  }
  return shown;
}

/** Forget the pair's pictures; clips that the next trial shows again stay decoded. */
export function releasePair(session: Session, trial: TrialInfo, next: TrialInfo | null): void {
  release(session, trial, next);
  for (const { role } of trial.clips) session.player.release(`${trial.trial_index} ${role}`);
  session.player.release(`${trial.trial_index} pair`);
}
