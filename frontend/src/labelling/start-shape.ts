/** The shape a new frame begins with: the template, the nearest labelled frame's, or a proposal from all of them. */

import { type Grey, greyOfCanvas } from "./grey";
import { type Shape, templateShape } from "./points";
import { FRAMES_BEFORE_PROPOSALS, proposeShape } from "./propose";
import type { OpenedVideo } from "./video";

const MAX_SOURCES = 24;

export interface Start {
  readonly number: number;
  readonly shape: Shape;
  readonly from: "template" | "nearest" | "proposal";
}

export async function startShape(
  video: OpenedVideo,
  { number, canvas }: { number: number; canvas: HTMLCanvasElement },
  accepted: readonly [number, Shape][],
  eyes: 1 | 2,
  greys: Map<number, Grey>,
): Promise<Start> {
  const nearest = [...accepted].sort(([a], [b]) => Math.abs(a - number) - Math.abs(b - number));
  const first = nearest[0];
  if (first === undefined) return { number, shape: templateShape(eyes, video.size), from: "template" };
  if (nearest.length < FRAMES_BEFORE_PROPOSALS) return { number, shape: first[1], from: "nearest" };
  const sources = [];
  for (const [source, shape] of nearest.slice(0, MAX_SOURCES)) {
    const picture = greys.get(source) ?? greyOfCanvas(await video.frame(source));
    greys.set(source, picture);
    sources.push({ picture, shape });
  }
  return { number, shape: proposeShape(greyOfCanvas(canvas), sources), from: "proposal" };
}
