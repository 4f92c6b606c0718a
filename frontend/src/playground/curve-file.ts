/** A performance of the playground as a file, in the columns of `stimuli performance --format csv`. */
import { BlinkEngine, type EngineOptions } from "../blink-engine";

const LOWER_UP_MM = 0.75;
const LOWER_IN_MM = 2.6;

/** Seconds and frames per second of what is saved. */
export interface Length {
  seconds: number;
  fps: number;
}

export function curveCsv(options: EngineOptions, { seconds, fps }: Length): string {
  const engine = new BlinkEngine(options);
  const rows = Array.from({ length: Math.round(seconds * fps) }, (_, frame) => {
    const lids = engine.frame(frame / fps);
    const up = (LOWER_UP_MM * (lids.left_lower_up + lids.right_lower_up)) / 2;
    const nasal = (LOWER_IN_MM * (lids.left_lower_in + lids.right_lower_in)) / 2;
    return [
      frame,
      (frame / fps).toFixed(6),
      ...[lids.left, lids.right, up, nasal].map((value) => String(Math.round(value * 1e6) / 1e6)),
    ].join();
  });
  return ["frame,time_s,closure_left,closure_right,lower_up_mm,lower_nasal_mm", ...rows, ""].join("\n");
}
