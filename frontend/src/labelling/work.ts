/** The labels of one video as they grow: every step of the labeling page, from one state to the next. */
import { defaultMarkers, type LabelFile } from "./label-file";
import {
  acceptedOf,
  chooseFrames,
  type Frames,
  isProposed,
  type LabelledFrame,
  type Looked,
  problemOf,
  requireSameVideo,
} from "./labelled-frames";
import { type Point, type Shape, withEyeMoved, withEyeStretched, withPoint } from "./points";
import type { OpenedVideo } from "./video";

// States that can be undone and done again; a drag is one step.

const LONGEST = 500;

export interface History<T> {
  readonly now: T;
  readonly past: readonly T[];
  readonly future: readonly T[];
  /** Changes with the same name, one after the other, are one step; null begins a new one. */
  readonly step: string | null;
}

export function begun<T>(now: T): History<T> {
  return { now, past: [], future: [], step: null };
}

/** A change; one that carries the name of the step before joins it. */
export function changed<T>(history: History<T>, now: T, step: string | null = null): History<T> {
  if (now === history.now) return history;
  if (step !== null && step === history.step) return { ...history, now, future: [] };
  return { now, past: [...history.past, history.now].slice(-LONGEST), future: [], step };
}

export function undone<T>(history: History<T>): History<T> {
  const now = history.past.at(-1);
  if (now === undefined) return history;
  return { now, past: history.past.slice(0, -1), future: [history.now, ...history.future], step: null };
}

export function redone<T>(history: History<T>): History<T> {
  const now = history.future[0];
  if (now === undefined) return history;
  return { now, past: [...history.past, history.now], future: history.future.slice(1), step: null };
}

type EyeCount = 1 | 2;
export type MoveKind = "point" | "eye" | "stretch";

export interface Work {
  readonly opened: { readonly video: OpenedVideo; readonly looked: Looked } | null;
  readonly eyes: EyeCount;
  readonly markers: Pick<LabelFile, "midUpper" | "midLower" | "rest">;
  readonly history: History<Frames>;
  readonly saved: Frames;
  /** The frames to label, ascending. */
  readonly chosen: readonly number[];
  readonly current: number;
  readonly selected: number | null;
  readonly problem: string | null;
}

const NO_FRAMES: Frames = new Map();

export const NO_WORK: Work = {
  opened: null,
  eyes: 2,
  markers: { ...defaultMarkers(2), rest: {} },
  history: begun(NO_FRAMES),
  saved: NO_FRAMES,
  chosen: [],
  current: 0,
  selected: null,
  problem: null,
};

/** Frames taken as they are and as saved: nothing before them to undo. */
function begunWith(work: Work, frames: Frames, eyes: EyeCount): Work {
  const markers = { ...defaultMarkers(eyes), rest: {} };
  return { ...work, eyes, markers, history: begun(frames), saved: frames, selected: null };
}

export function withVideo(work: Work, video: OpenedVideo, looked: Looked): Work {
  const chosen = chooseFrames(looked, [], work.eyes);
  return { ...begunWith(work, NO_FRAMES, work.eyes), opened: { video, looked }, chosen, current: chosen[0] ?? 0, problem: null };
}

/** Labels made before; a `LabelProblem` says why they do not belong to the opened video. */
export function withLabels(work: Work, name: string, labels: LabelFile): Work {
  if (work.opened === null) return work;
  requireSameVideo(name, labels, work.opened.video);
  const { eyes, midUpper, midLower, rest } = labels;
  const numbers = [...labels.frames.keys()];
  const frames: Frames = new Map([...labels.frames].map(([number, shape]) => [number, { shape, accepted: !isProposed(labels, number) }]));
  const chosen = chooseFrames(work.opened.looked, numbers, eyes);
  return {
    ...begunWith(work, frames, eyes),
    markers: { midUpper, midLower, rest },
    chosen,
    current: numbers[0] ?? chosen[0] ?? 0,
    problem: null,
  };
}

/** Another number of eyes: points and frames start over, because other blinks may be known. */
export function withEyes(work: Work, eyes: EyeCount): Work {
  const next = begunWith(work, NO_FRAMES, eyes);
  if (work.opened === null) return next;
  const chosen = chooseFrames(work.opened.looked, [], eyes);
  return { ...next, chosen, current: chosen[0] ?? 0 };
}

function withCurrent(work: Work, frame: LabelledFrame, step: string | null): Work {
  return { ...work, history: changed(work.history, new Map(work.history.now).set(work.current, frame), step) };
}

/** A point or an eye of the shown shape moved; a shape that `stimuli` would refuse is no longer accepted. */
export function withMove(
  work: Work,
  shown: Shape,
  { index, to, kind, step }: { index: number; to: Point; kind: MoveKind; step: string | null },
): Work {
  if (work.opened === null) return work;
  const { video } = work.opened;
  const shape = { point: withPoint, eye: withEyeMoved, stretch: withEyeStretched }[kind](shown, index, to, video.size);
  const problem = problemOf(work.current, shape, video);
  const accepted = (work.history.now.get(work.current)?.accepted ?? false) && problem === null;
  return { ...withCurrent(work, { shape, accepted }, step), problem };
}

/** The shown shape accepted, or the problem that `stimuli` would have with it. */
export function withAccepted(work: Work, shown: Shape): Work {
  if (work.opened === null) return work;
  const problem = problemOf(work.current, shown, work.opened.video);
  if (problem !== null) return { ...work, problem };
  return { ...withCurrent(work, { shape: shown, accepted: true }, null), problem };
}

/** A frame of the video; one that was not among those to label joins them. */
export function atFrame(work: Work, number: number): Work {
  if (work.opened === null) return work;
  const current = Math.max(0, Math.min(work.opened.video.frameCount - 1, number));
  const chosen = work.chosen.includes(current) ? work.chosen : [...work.chosen, current].sort((a, b) => a - b);
  return { ...work, chosen, current, problem: null };
}

/** The next or previous of the frames to label; the last and the first stay. */
export function atNeighbour(work: Work, by: 1 | -1): Work {
  const number = work.chosen[work.chosen.indexOf(work.current) + by];
  return number === undefined ? work : atFrame(work, number);
}

export function withoutCurrent(work: Work): Work {
  const frames = new Map(work.history.now);
  return frames.delete(work.current) ? { ...work, history: changed(work.history, frames) } : work;
}

export function withUndo(work: Work): Work {
  return { ...work, history: undone(work.history), problem: null };
}

export function withRedo(work: Work): Work {
  return { ...work, history: redone(work.history), problem: null };
}

/** What `stimuli track --labels` is given: the accepted frames; of these none is a mere proposal any more. */
export function labelFileOf({ opened, eyes, markers, history }: Work): (LabelFile & { video: string }) | null {
  if (opened === null) return null;
  const { name, size } = opened.video;
  const rest = { ...markers.rest, proposed: {} };
  return { video: name, size, eyes, ...markers, rest, frames: new Map(acceptedOf(history.now)) };
}
