/** Which clips a showing had, and what was drawn of each. */
import type { ShownClips, TrialInfo } from "../../../api/schema";
import type { RolesShown } from "../../views/ledger";

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
