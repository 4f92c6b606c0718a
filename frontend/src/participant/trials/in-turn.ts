/** Clips of several roles: shown one after the other in the same place, and recorded by role. */
import type { TrialClip, TrialInfo, ShownClips } from "../../api/schema";
import { watchFocus } from "../screen/window";
import type { Session } from "../session";
import type { RolesShown } from "../views/ledger";
import { decodeAll, whileDecoding } from "./trial";
import { showOnce, type Shown, type Stage } from "./showing";

// The clips of a trial one after the other in the same place, with plain background between them.

interface InTurn {
  clips: readonly TrialClip[];
  gap_ms: number;
  /** A fixation cross before the first clip, where there is one. */
  fixation_ms?: number;
  /** What is below a clip while it runs, by its role. */
  labels?: Record<string, string>;
}

/** Decode every clip of a trial, and blank the place for the first. Throws ClipBroken. */
export function prepareInTurn(session: Session, stage: Stage, trial: TrialInfo, [first]: readonly TrialClip[]): Promise<void> {
  return whileDecoding(session, stage, async () => {
    await decodeAll(session, trial);
    if (first) session.player.blank(first.clip_sha256);
  });
}

/** Show the clips; times count from the press that started the first. */
export async function showInTurn(
  session: Session,
  stage: Stage,
  { trial_index }: TrialInfo,
  { clips, gap_ms, fixation_ms = 0, labels = {} }: InTurn,
  key_at_ms: number,
  kept: Promise<void>,
): Promise<RolesShown[]> {
  const shown: RolesShown[] = [];
  for (const { role, clip_sha256 } of clips) {
    const lost = shown.length > 0 ? await plainBackground(session, stage, clip_sha256, gap_ms) : 0;
    const showing = withFocusLost(
      await showOnce(session, stage, clip_sha256, key_at_ms, shown.length ? 0 : fixation_ms, kept, labels[role]),
      lost,
    );
    if (showing.focus_lost > 0) session.events.add("focus_lost", { trial_index });
    shown.push({ roles: [role], showing });
  }
  return shown;
}

/** Plain background before the next clip; resolves with how often the page was hidden or lost focus meanwhile. */
async function plainBackground(session: Session, stage: Stage, next_sha256: string, gap_ms: number): Promise<number> {
  stage.setPlaying(true);
  stage.below.replaceChildren();
  session.player.blank(next_sha256);
  const focus = watchFocus();
  await new Promise((resolve) => setTimeout(resolve, gap_ms));
  return focus.stop();
}

/** A rater who looks away between two clips cannot compare them: it disturbs the clip that follows. */
function withFocusLost(showing: Shown, lost: number): Shown {
  if (lost === 0) return showing;
  const focus_lost = showing.focus_lost + lost;
  return { ...showing, focus_lost, disturbances: { ...showing.disturbances, focus_lost } };
}

// Which clips a showing had, and what was drawn of each.

/** Frames of each clip that were drawn: one of a shorter clip holds its last frame while the longer goes on. */
export function clipsOf(trial: TrialInfo, shown: readonly RolesShown[]): ShownClips {
  return Object.fromEntries(
    trial.clips.map((clip) => {
      const log = shown.find(({ roles }) => roles.includes(clip.role))?.showing.drawn ?? [];
      const drawn = new Set(log.map(([index]) => Math.min(index, clip.frames - 1))).size;
      return [clip.role, { clip_sha256: clip.clip_sha256, frames_drawn: drawn, frames_missing: clip.frames - drawn }];
    }),
  );
}
