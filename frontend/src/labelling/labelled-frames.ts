/** Labelled frames of one video: which to label, and whether labels fit the video. */

import { ASIDE, BRIEF_CHANGES, briefChanges, farthestPictures, FRAMES_TO_LABEL } from "./choose-frames";
import { type EyesOfVideo, eyesFor } from "./eyes";
import type { Grey } from "./grey";
import { checkShape, type LabelFile, LabelProblem } from "./label-file";
import type { Shape } from "./points";
import type { OpenedVideo } from "./video";

export interface LabelledFrame {
  readonly shape: Shape;
  readonly accepted: boolean;
}

export type Frames = ReadonlyMap<number, LabelledFrame>;
/** The frames looked at to find unlike ones. */
export interface Looked {
  readonly candidates: readonly number[];
  readonly pictures: readonly Grey[];
  readonly eyes: EyesOfVideo;
}

export function acceptedOf(frames: Frames): [number, Shape][] {
  return [...frames].filter(([, { accepted }]) => accepted).map(([number, { shape }]) => [number, shape]);
}

/** Whether a frame's points are still those that a program proposed: they wait to be accepted. */
export function isProposed({ frames, rest }: LabelFile, number: number): boolean {
  const proposals = new Map(Object.entries(rest["proposed"] ?? {}));
  return JSON.stringify(proposals.get(String(number))) === JSON.stringify(frames.get(number));
}

/** Places of blinks: those of the eyes found, then other brief changes, up to eight. */
function briefPlaces({ pictures, eyes }: Looked, count: 1 | 2): number[] {
  const blinks = (eyesFor(eyes, count)?.blinks ?? []).slice(0, BRIEF_CHANGES);
  const others = briefChanges(pictures).filter((change) => blinks.every((blink) => Math.abs(blink - change) > ASIDE));
  return [...blinks, ...others].slice(0, BRIEF_CHANGES);
}

/** About 20 frames: those labelled, blinks and other brief changes, and ones as unlike these as there are. */
export function chooseFrames(looked: Looked, labelled: readonly number[], eyes: 1 | 2): number[] {
  const { candidates, pictures } = looked;
  const taken = labelled.map((number) =>
    candidates.reduce(
      (best, candidate, index) => (Math.abs(candidate - number) < Math.abs((candidates[best] ?? 0) - number) ? index : best),
      0,
    ),
  );
  const brief = briefPlaces(looked, eyes).slice(0, Math.max(0, FRAMES_TO_LABEL - taken.length));
  // The first picture is an open eye as a rule: without it and labels, only blinks would be known.
  const begun = brief.length > 0 && taken.length === 0 ? [0, ...brief] : [...taken, ...brief];
  const indices = farthestPictures(pictures, FRAMES_TO_LABEL, begun).filter((index) => !taken.includes(index));
  const added = indices.map((index) => candidates[index] ?? 0);
  return [...new Set([...labelled, ...added])].sort((a, b) => a - b);
}

export function requireSameVideo(name: string, labels: LabelFile, video: OpenedVideo): void {
  const [[width, height], [wide, high]] = [labels.size, video.size];
  if (width !== wide || height !== high) {
    throw new LabelProblem(
      `${name}: labels were made on ${width} x ${height} pixels, the video has ${wide} x ${high}; ` + "use the video they were made on",
    );
  }
  const beyond = [...labels.frames.keys()].find((number) => number >= video.frameCount);
  if (beyond === undefined) return;
  throw new LabelProblem(`${name}: frame ${beyond} is labelled, the video ends at frame ${video.frameCount - 1}`);
}

export function problemOf(number: number, shape: Shape, video: OpenedVideo): string | null {
  try {
    checkShape(`frame ${number}`, shape, video.size);
    return null;
  } catch (error) {
    if (error instanceof LabelProblem) return error.message;
    throw error;
  }
}
