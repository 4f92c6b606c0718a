/**
 * What was on the screen when, from the stored logs: every frame from the moment it was drawn to the next one's.
 * Times are ms since the start key of a play's first view, by the participant's clock.
 */

import { adminKind } from "../kinds";
import type { Schemas } from "../api";
import { fixed, plain, words } from "../ui/format";

export type Play = Schemas["ReplayedPlay"];
export type Clip = Schemas["ReplayedClip"];
export type View = Schemas["ReplayedView"];

/** Frame `index` was shown from `from_ms` until `to_ms`. */
export interface ShownFrame {
  index: number;
  from_ms: number;
  to_ms: number;
}
/** One clip of one view. */
export interface Lane {
  role: string;
  sha256: string;
  shown: ShownFrame[];
  /** Frames of the clip that its log does not have, in ranges. */
  missing: [first: number, last: number][];
  /** Frames shown longer than a frame's period and one refresh. */
  held: ShownFrame[];
}
export interface Scene {
  view: View;
  start_ms: number;
  end_ms: number;
  lanes: Lane[];
}
export interface PlayedBack {
  scenes: Scene[];
  /** When the answer came; null without one, or where no page saw both clip and answer. */
  answered_ms: number | null;
  end_ms: number;
}

/** The gap drawn before a view that has no times. */
const UNKNOWN_GAP_MS = 500;
const ASSUMED_REFRESH_MS = 1000 / 60;
/** Scheduling jitter of a time stamp that does not count as lateness. */
const JITTER_MS = 2;

export function playedBack(play: Play, clips: readonly Clip[]): PlayedBack {
  const scenes: Scene[] = [];
  const origin = momentOf(play.views[0]?.started_at_client);
  for (const view of play.views) {
    const after = scenes.at(-1)?.end_ms;
    const began = momentOf(view.started_at_client);
    const known_ms = began === null || origin === null ? null : began - origin;
    const earliest = after === undefined ? 0 : after;
    const start_ms = known_ms === null ? (after === undefined ? 0 : after + UNKNOWN_GAP_MS) : Math.max(known_ms, earliest);
    scenes.push(sceneOf(view, start_ms, clips, refreshOf(play)));
  }
  const answered_ms = answeredAt(play, scenes.at(-1), origin);
  const ends = scenes.map(({ end_ms }) => end_ms);
  return { scenes, answered_ms, end_ms: Math.max(0, ...ends, answered_ms ?? 0) };
}

const momentOf = (text: string | null | undefined): number | null => (text ? Date.parse(text) : null);
const refreshOf = ({ refresh_rate_hz }: Play): number => (refresh_rate_hz ? 1000 / refresh_rate_hz : ASSUMED_REFRESH_MS);

function sceneOf(view: View, start_ms: number, clips: readonly Clip[], refresh_ms: number): Scene {
  const lanes = view.clips.map(({ role, clip_sha256, drawn }): Lane => {
    const clip = clips.find((one) => one.clip_sha256 === clip_sha256);
    const showing = view.showings?.find(({ roles }) => roles.some((one) => one === role));
    const period_ms = 1000 / (showing?.fps ?? clip?.fps ?? 30);
    const shown = framesOf(drawn, start_ms, showing?.ended_ms ?? null, period_ms);
    return {
      role,
      sha256: clip_sha256,
      shown,
      missing: missingOf(shown, clip?.frames ?? 0),
      held: shown.filter(({ from_ms, to_ms }) => to_ms - from_ms > period_ms + refresh_ms + JITTER_MS),
    };
  });
  const ends = [...lanes.flatMap(({ shown }) => shown.at(-1)?.to_ms ?? []), ...(view.showings ?? []).map((one) => start_ms + one.ended_ms)];
  return { view, start_ms, end_ms: Math.max(start_ms, ...ends), lanes };
}

/** Repeated entries of one frame make one shown frame; the last one lasts until the clip's end, or for one period if that is not known. */
function framesOf(
  drawn: readonly (readonly [number, number])[],
  start_ms: number,
  ended_ms: number | null,
  period_ms: number,
): ShownFrame[] {
  const firsts = drawn.filter(([index], row) => row === 0 || drawn[row - 1]?.[0] !== index);
  return firsts.map(([index, ms], row) => {
    const next = firsts[row + 1]?.[1] ?? Math.max(ms, ended_ms ?? ms + period_ms);
    return { index, from_ms: start_ms + ms, to_ms: start_ms + next };
  });
}

function missingOf(shown: readonly ShownFrame[], frames: number): [number, number][] {
  const drawn = new Set(shown.map(({ index }) => index));
  const ranges: [number, number][] = [];
  for (let index = 0; index < frames; index += 1) {
    if (drawn.has(index)) continue;
    const last = ranges.at(-1);
    if (last && last[1] === index - 1) last[1] = index;
    else ranges.push([index, index]);
  }
  return ranges;
}

/** Response times count from what the last view drew; without them the clock's own moment counts. */
function answeredAt(play: Play, last: Scene | undefined, origin: number | null): number | null {
  const starts = last?.lanes.flatMap(({ shown }) => shown[0] ?? []) ?? [];
  // In turn, the answer's times are those of the clip shown last.
  const first = starts.toSorted((one, other) => other.from_ms - one.from_ms)[0];
  if (first && play.rt_from_first_frame !== null) return first.from_ms + play.rt_from_first_frame;
  const answered = momentOf(play.answered_at_client);
  return answered === null || origin === null ? null : Math.max(0, answered - origin);
}

/** The frame on the screen at a moment; null where the lane showed nothing. */
function frameAt({ shown }: Lane, at_ms: number): ShownFrame | null {
  let low = 0;
  let high = shown.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((shown[middle]?.from_ms ?? Infinity) <= at_ms) low = middle + 1;
    else high = middle;
  }
  const frame = shown[low - 1];
  return frame && at_ms < frame.to_ms ? frame : null;
}

export interface Shown {
  scene: Scene | null;
  /** The clips on the canvas. */
  frames: { lane: Lane; frame: ShownFrame }[];
}

export function shownAt({ scenes }: PlayedBack, at_ms: number): Shown {
  const scene = scenes.findLast(({ start_ms, end_ms }) => start_ms <= at_ms && at_ms < end_ms) ?? null;
  const frames = (scene?.lanes ?? []).flatMap((lane) => {
    const frame = frameAt(lane, at_ms);
    return frame ? [{ lane, frame }] : [];
  });
  return { scene, frames };
}

/** The moments at which the picture changed, ascending: where arrow keys stop. */
export function changesOf({ scenes }: PlayedBack): number[] {
  const moments = scenes.flatMap(({ start_ms, end_ms, lanes }) => [
    start_ms,
    ...lanes.flatMap(({ shown }) => shown.flatMap(({ from_ms, to_ms }) => [from_ms, to_ms])),
    end_ms,
  ]);
  return [...new Set(moments)].sort((one, other) => one - other);
}

export function nextChange(changes: readonly number[], at_ms: number): number {
  return changes.find((moment) => moment > at_ms) ?? at_ms;
}

export function changeBefore(changes: readonly number[], at_ms: number): number {
  return changes.findLast((moment) => moment < at_ms) ?? at_ms;
}

// The words next to a replay.

/** What was answered, whatever the kind of trial: each key of the answer that says something. */
export function answerWords({ answer }: Pick<Play, "answer">): string {
  if (answer === null) return "no answer";
  // How a trial came about, which is not what was answered: it is said after an answer, and makes none.
  const { answers, values, known, arrangement, step_frames, moves, ...rest } = answer;
  const parts: string[] = [];
  if (isRecord(answers)) {
    for (const [scale, one] of Object.entries(answers)) {
      if (!isRecord(one)) continue;
      parts.push(`${words(scale)} ${one["not_applicable"] === true ? "not applicable" : plain(one["response"] ?? "–")}`);
    }
  }
  if (Array.isArray(values)) parts.push(`${values.length} samples of the slider`);
  for (const [key, value] of Object.entries(rest)) {
    const isSaid = key === "kind" || value === null || (key === "response" && parts.length > 0) || value === false;
    if (!isSaid) parts.push(value === true ? words(key) : `${words(key)} ${typeof value === "string" ? words(value) : plain(value)}`);
  }
  if (parts.length === 0) return "no answer";
  for (const [key, value] of Object.entries({ step_frames, moves, arrangement })) {
    if (value !== undefined && value !== null) parts.push(`${words(key)} ${typeof value === "string" ? words(value) : plain(value)}`);
  }
  if (typeof known === "number") parts.push(`stimulus chosen by ${known === 1 ? "1 answer" : `${known} answers`} before`);
  return parts.join(", ");
}

const isRecord = (value: unknown): value is Record<string, unknown> => typeof value === "object" && value !== null && !Array.isArray(value);

/** "12, 15 to 18", or "none". */
export function missingWords({ missing }: Lane): string {
  return missing.map(([first, last]) => (first === last ? String(first) : `${first} to ${last}`)).join(", ") || "none";
}

export function longestWords({ shown }: Lane): string {
  const longest = shown.toSorted((one, other) => other.to_ms - other.from_ms - (one.to_ms - one.from_ms))[0];
  return longest ? `frame ${longest.index}, ${fixed(longest.to_ms - longest.from_ms, 1)} ms` : "–";
}

/** The slider of a continuous rating over the time line: when each sampled frame was shown, and how far up the slider was. */
export function traceOf(play: Play, played: PlayedBack, trial: Schemas["Replay"]["trial"]): [number, number][] {
  const { values, step_frames } = play.answer ?? {};
  const lane = played.scenes.at(-1)?.lanes[0];
  const slider = adminKind(trial.kind).sliderRange?.(trial);
  if (!slider || !lane || !Array.isArray(values) || typeof step_frames !== "number") return [];
  const range = Math.max(1e-9, slider.maximum - slider.minimum);
  return values.flatMap((value: unknown, sample): [number, number][] => {
    const frame = lane.shown.find(({ index }) => index >= sample * step_frames);
    return frame && typeof value === "number" ? [[frame.from_ms, (value - slider.minimum) / range]] : [];
  });
}

// Long waits, such as ten minutes before an answer, are drawn and played as short ones: a time line of knots.

/** Waits longer than this are folded to it. */
const FOLDED_MS = 1_500;

type Knot = readonly [real_ms: number, folded_ms: number];

export interface Folding {
  knots: readonly Knot[];
  length_ms: number;
  fold(real_ms: number): number;
  unfold(folded_ms: number): number;
}

/** Fold whatever is between these spans, up to `end_ms`; spans ascend and do not overlap. */
export function folding(spans: readonly { start_ms: number; end_ms: number }[], end_ms: number): Folding {
  const knots: Knot[] = [[0, 0]];
  const add = (real_ms: number, is_wait: boolean): void => {
    const [real_before, folded_before] = knots.at(-1) ?? [0, 0];
    if (real_ms <= real_before) return;
    const length = real_ms - real_before;
    knots.push([real_ms, folded_before + (is_wait ? Math.min(length, FOLDED_MS) : length)]);
  };
  for (const span of spans) {
    add(span.start_ms, true);
    add(span.end_ms, false);
  }
  add(end_ms, true);
  return {
    knots,
    length_ms: knots.at(-1)?.[1] ?? 0,
    fold: (real_ms) => between(knots, real_ms, 0, 1),
    unfold: (folded_ms) => between(knots, folded_ms, 1, 0),
  };
}

function between(knots: readonly Knot[], value: number, from: 0 | 1, to: 0 | 1): number {
  const after = knots.findIndex((knot) => knot[from] >= value);
  const [right, left] = [knots[after < 0 ? knots.length - 1 : after], knots[after - 1]];
  if (!right) return 0;
  if (!left || after < 0) return right[to];
  return left[to] + ((right[to] - left[to]) * (value - left[from])) / (right[from] - left[from]);
}
