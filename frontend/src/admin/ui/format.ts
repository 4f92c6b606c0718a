/** Numbers, times, verdicts and origins as the pages write them. */

import type { Schemas } from "../api";

// Numbers and times as the pages write them.

export function when(moment: string | null): string {
  return moment === null ? "–" : new Date(moment).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });
}

/** A moment to come: the time alone where it is today. */
export function soon(moment: string | null, now: string): string {
  if (moment === null) return "–";
  const then = new Date(moment);
  const today = then.toDateString() === new Date(now).toDateString();
  return then.toLocaleString(
    undefined,
    today ? { timeStyle: "short" } : { day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" },
  );
}

export function ago(moment: string, now: string): string {
  const seconds = Math.max(0, (Date.parse(now) - Date.parse(moment)) / 1000);
  if (seconds < 5) return "just now";
  if (seconds < 60) return `${Math.round(seconds)} s ago`;
  if (seconds < 3600) return `${Math.round(seconds / 60)} min ago`;
  return seconds < 172_800 ? `${Math.round(seconds / 3600)} h ago` : `${Math.round(seconds / 86_400)} days ago`;
}

export function fixed(value: number | null | undefined, digits = 2): string {
  return value === null || value === undefined ? "–" : value.toFixed(digits);
}

/** "1 run", "2 runs". */
export function counted(number: number, thing: string, several = `${thing}s`): string {
  return `${number.toLocaleString()} ${number === 1 ? thing : several}`;
}

/** A key of the data as words: "forms_before" is "forms before". */
export function words(key: string): string {
  return key.replaceAll("_", " ");
}

/** "Chrome on Linux" from what a browser says of itself. */
export function browserName(agent: string): string {
  const names = ["Edg", "OPR", "Firefox", "Chrome", "Safari"];
  const browser = names.find((name) => agent.includes(`${name}/`));
  const shown = { Edg: "Edge", OPR: "Opera" }[browser ?? ""] ?? browser;
  const system = ["Android", "iPhone", "iPad", "Windows", "Mac OS", "Linux"].find((name) => agent.includes(name));
  return shown === undefined ? agent.slice(0, 60) || "unknown" : `${shown}${system === undefined ? "" : ` on ${system}`}`;
}

/** "English (en)" from a language's code. */
export function languageName(code: string): string {
  const name = new Intl.DisplayNames(undefined, { type: "language", fallback: "none" }).of(code);
  return name === undefined ? code : `${name} (${code})`;
}

/** A value of any type as text: a list or an object as JSON. */
export function plain(value: unknown): string {
  return typeof value === "string" ? value : JSON.stringify(value);
}

/** Colors of the badges of verdicts: white can be read on each. */
export const VERDICT_COLOURS: Record<string, string> = { good: "teal.9", uncertain: "blue.9", flagged: "#8a5a00", failed: "red.9" };

// How a play of a clip was judged and shown, in words: the data have the names of rules and methods.

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

// Whose answers are shown together: never those of two origins.

export type DataOrigin = "participant" | "pilot" | "simulated";

export const ORIGINS: { value: DataOrigin; label: string }[] = [
  { value: "participant", label: "Participants" },
  { value: "pilot", label: "Pilot" },
  { value: "simulated", label: "Simulated" },
];

export function labelOfOrigin(word: string): string {
  return ORIGINS.find((origin) => origin.value === word)?.label ?? word;
}

export function originOf(word: string): DataOrigin {
  return ORIGINS.find((origin) => origin.value === word)?.value ?? "participant";
}

export type Role = Schemas["AccountOut"]["role"];
export const ROLES: Role[] = ["viewer", "experimenter", "owner"];

export function asRole(word: string | null): Role {
  return ROLES.find((role) => role === word) ?? "viewer";
}
