/** The shape a new frame begins with: the template, the nearest labelled frame's, or a proposal from all of them. */

import { eyesFor, placesOn, shapeOn } from "./eyes";
import { type Grey, greyOfCanvas } from "./grey";
import { inside, type Shape, type Size, templateShape } from "./points";
import type { Looked } from "./labelled-frames";
import { FRAMES_BEFORE_PROPOSALS, proposeShape } from "./propose";
import type { OpenedVideo } from "./video";

const MAX_SOURCES = 24;

export interface Start {
  readonly number: number;
  readonly shape: Shape;
  readonly from: "template" | "eyes" | "nearest" | "proposal";
}

export async function startShape(
  { video, looked }: { readonly video: OpenedVideo; readonly looked: Looked },
  { number, canvas }: { number: number; canvas: HTMLCanvasElement },
  accepted: readonly [number, Shape][],
  eyes: 1 | 2,
  greys: Map<number, Grey>,
): Promise<Start> {
  const nearest = [...accepted].sort(([a], [b]) => Math.abs(a - number) - Math.abs(b - number));
  const first = nearest[0];
  if (first === undefined) return firstShape(number, looked, eyes, video.size);
  if (nearest.length < FRAMES_BEFORE_PROPOSALS) return { number, shape: first[1], from: "nearest" };
  const sources = [];
  for (const [source, shape] of nearest.slice(0, MAX_SOURCES)) {
    const picture = greys.get(source) ?? greyOfCanvas(await video.frame(source));
    greys.set(source, picture);
    sources.push({ picture, shape });
  }
  return { number, shape: proposeShape(greyOfCanvas(canvas), sources), from: "proposal" };
}

/** Without a labelled frame: laid on the eyes found, as closed as they are there, or at a fixed place. */
function firstShape(number: number, { candidates, eyes: known }: Looked, eyes: 1 | 2, size: Size): Start {
  const blinking = eyesFor(known, eyes);
  if (blinking === null) return { number, shape: templateShape(eyes, size), from: "template" };
  const nearest = candidates.reduce(
    (best, candidate, index) => (Math.abs(candidate - number) < Math.abs((candidates[best] ?? 0) - number) ? index : best),
    0,
  );
  const shape = shapeOn(placesOn(blinking, nearest, known.size, size), blinking.closed[nearest] ?? 0);
  return { number, shape: shape.map((point) => inside(point, size)), from: "eyes" };
}
