/** Messages between the page and the worker that decodes and draws. Times are absolute: timeOrigin + now, in ms. */

import type { Part } from "./player";
import type { Evenness } from "./refresh-clock";

export type ToWorker =
  | { type: "canvas"; canvas: OffscreenCanvas; background: string; sync_patch: boolean }
  | { type: "prepare"; sha256: string; bytes: ArrayBuffer; fps: number | null }
  | { type: "play"; sha256: string; refresh_ms: number; fixation_ms: number }
  | { type: "compose"; sha256: string; parts: Part[]; width: number; height: number }
  | { type: "warm" }
  | { type: "blank"; width: number; height: number }
  | { type: "release"; sha256: string };

/** The worker's first message. */
export interface Started {
  type: "started";
}

export type FromWorker =
  | { type: "prepared"; sha256: string; frames: number; width: number; height: number; fps: number }
  | { type: "failed"; sha256: string; reason: string }
  | ({
      type: "played";
      sha256: string;
      drawn: [index: number, at_ms: number][];
      frames: number;
      fps: number;
      ended_at_ms: number;
    } & Evenness);

/** A clock that page and worker share: performance.now() counts from another origin in each. */
export function absoluteNow(): number {
  return performance.timeOrigin + performance.now();
}
