/** What the heat map's letters look like and mean. */
export const TRIAL_COLOURS = {
  g: ["#2a9d74", "good"],
  u: ["#6d9dc5", "uncertain"],
  f: ["#e0a100", "flagged"],
  x: ["#d1383d", "failed"],
  ".": ["#8883", "open"],
} as const;
