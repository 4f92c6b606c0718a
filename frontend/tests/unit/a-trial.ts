import type { TrialInfo } from "../../src/api/schema";

/** An assigned trial of one clip that nobody has seen yet, changed by `rest`. */
export const aTrial = (rest: Partial<TrialInfo> = {}): TrialInfo => ({
  trial_index: 0,
  kind: "main",
  block: 1,
  clip_sha256: "ab",
  frames: 45,
  fps: 30,
  width_px: 800,
  height_px: 300,
  width_mm: 130,
  inter_ocular_px: 400,
  clips: [],
  prompt: null,
  plays_done: 0,
  plays_wanted: 1,
  answered: false,
  views_begun: 0,
  views: [],
  ...rest,
});
