/** Messages between the page and the worker that decodes and draws. Times are absolute: timeOrigin + now, in ms. */

import type { Part } from "./player";
import type { Evenness } from "./refresh-clock";

/** What the worker answers, under the number that the page gave. */
export type Request =
  | { type: "prepare"; sha256: string; bytes: ArrayBuffer; fps: number | null }
  | { type: "play"; sha256: string; refresh_ms: number; fixation_ms: number }
  | { type: "compose"; sha256: string; parts: Part[]; width: number; height: number };

export type ToWorker =
  | (Request & { request: number })
  | { type: "canvas"; canvas: OffscreenCanvas; background: string; sync_patch: boolean }
  | { type: "warm" }
  | { type: "blank"; width: number; height: number }
  | { type: "release"; sha256: string };

/** The worker's first message. */
export interface Started {
  type: "started";
}

export type FromWorker =
  | { type: "prepared"; request: number; frames: number; width: number; height: number; fps: number }
  | { type: "failed"; request: number; reason: string }
  | ({
      type: "played";
      request: number;
      drawn: [index: number, at_ms: number][];
      frames: number;
      fps: number;
      ended_at_ms: number;
    } & Evenness);

/** A clock that page and worker share: performance.now() counts from another origin in each. */
export function absoluteNow(): number {
  return performance.timeOrigin + performance.now();
}
