/** Clips made ready to start at once: their bytes are here, they are decoded, and the stage has their size. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { ClipBroken } from "../../playback/player";
import { sourcesOf } from "../../screens/preload";
import type { Session } from "../../session";
import type { Stage } from "./stage";

const SOON_MS = 150;

/** What `make` gives; meanwhile the place says, where it takes long, what is waited for. Whatever fails is a ClipBroken. */
export async function whileDecoding<Made>(session: Session, stage: Stage | null, make: () => Promise<Made>): Promise<Made> {
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
export async function decodeClip(session: Session, trial: TrialInfo, sha256: string, fps: TrialInfo["fps"]): Promise<void> {
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

export function hashesOf(trial: TrialInfo): string[] {
  return sourcesOf([trial]).map(({ clip_sha256 }) => clip_sha256);
}
