/** Which clips a showing had, and what was drawn of each. */
import type { ShownClips, TrialInfo } from "../../../api/schema";
import type { Showing } from "../../playback/record";

/** A showing and the roles of the clips that were in it: one clock has drawn them all. */
export interface RolesShown {
  roles: string[];
  showing: Showing;
}

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

/** Both clips of a showing as the server keeps a view: each with the log of the one clock. */
export function seenClips(trial: TrialInfo, shown: readonly RolesShown[]): object[] {
  return trial.clips.map(({ role, clip_sha256, frames }) => {
    const showing = shown.find(({ roles }) => roles.includes(role))?.showing;
    const start = showing?.key_at_ms ?? 0;
    const log = (showing?.drawn ?? []).map(([index, at_ms]): [number, number] => [Math.min(index, frames - 1), at_ms - start]);
    const first = log.filter(([index], place) => place === 0 || log[place - 1]?.[0] !== index);
    return { role, clip_sha256, drawn: first.map(([index, ms]) => [index, Math.round(ms * 100) / 100]) };
  });
}
