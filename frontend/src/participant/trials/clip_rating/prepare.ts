/** A clip made ready to start at once: its bytes are here, it is decoded, and the stage has its size. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { ClipBroken } from "../../playback/player";
import { sourcesOf } from "../../screens/preload";
import type { Session } from "../../session";
import type { Stage } from "../shared/stage";

const SOON_MS = 150;

/** Decode ahead with `place` null; with a place, also blank the stage and say so where it takes long. */
export async function prepareClip(session: Session, trial: TrialInfo, place: Stage | null): Promise<string> {
  const sha256 = trial.clip_sha256;
  if (!sha256) throw new ClipBroken("expected a clip, the trial has none");
  const say = setTimeout(() => place?.below.replaceChildren(h("p", { role: "status" }, session.t("decoding"))), SOON_MS);
  try {
    const bytes = session.clips.get(sha256) ?? (await fetched(session, trial, sha256));
    await session.player.prepare(sha256, bytes, trial.fps);
    if (place) session.player.blank(sha256);
    return sha256;
  } catch (error) {
    throw error instanceof ClipBroken ? error : new ClipBroken(String(error));
  } finally {
    clearTimeout(say);
  }
}

async function fetched(session: Session, trial: TrialInfo, sha256: string): Promise<ArrayBuffer> {
  await session.clips.load(sourcesOf([trial]));
  const bytes = session.clips.get(sha256);
  if (!bytes) throw new ClipBroken("the clip could not be loaded");
  return bytes;
}
