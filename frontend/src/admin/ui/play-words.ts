/** How a play of a clip was judged and shown, in words: the data have the names of rules and methods. */

import { words } from "./format";

const RULES: Readonly<Record<string, string>> = {
  failed_missing_frames: "many frames missing",
  flagged_missing_frames: "frames missing",
  flagged_late_frames: "frames late",
  failed_longest_gap_ms: "long gap between frames",
  flagged_longest_gap_ms: "gap between frames",
  uncertain_unevenness_ms: "uneven clock of the page",
  video_fallback: "shown by the video element",
  clip_not_played: "the browser could not play it",
  wrong_clip: "another clip was shown",
  not_rated: "no answer could be given",
  impossible_value: "the browser reported an impossible number",
  no_clock_record: "no record of the clock",
};

const METHODS: Readonly<Record<string, string>> = {
  webcodecs: "frame by frame (WebCodecs)",
  video: "the video element",
  none: "not played",
};

/** Why a play is not good; rules that nothing is known of by their names. */
export function ruleWords(rule: string): string {
  return RULES[rule] ?? words(rule);
}

export function methodWords(method: string): string {
  return METHODS[method] ?? words(method);
}
