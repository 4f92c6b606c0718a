/** Trials that show several clips need all of them before the first begins. */
import type { TrialInfo } from "../../../api/schema";
import type { Session } from "../../session";
import { decodeClip } from "./prepare";

/** Decode every clip of a trial. Throws ClipBroken where one cannot be had. */
export async function decodeAll(session: Session, trial: TrialInfo): Promise<void> {
  await Promise.all(trial.clips.map(({ clip_sha256, fps }) => decodeClip(session, trial, clip_sha256, fps)));
}
