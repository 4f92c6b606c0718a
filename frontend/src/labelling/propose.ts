/** The start shape of a new frame, found from frames labeled before by correlating patches of the pictures. */
import { type Grey, cut, type Directions, PLANE, searchFinely, greyOfCanvas } from "./grey";
import { at, eyeCount, eyeOf, eyeWidth, type Point, type Shape, inside, type Size, templateShape } from "./points";
import { eyesFor, placesOn, shapeOn } from "./eyes";
import type { Looked } from "./labelled-frames";
import type { OpenedVideo } from "./video";

export const FRAMES_BEFORE_PROPOSALS = 5;
const EYE_COLUMNS = 32;
const EYE_ROWS = 20;
const EYE_REACH = 8;
const POINT_SIDE = 11;
const POINT_REACH = 5;
/** A point's patch below this correlation says nothing; the point stays where the eye's patch put it. */
const POINT_LEAST = 0.6;

export interface Labelled {
  readonly picture: Grey;
  readonly shape: Shape;
}

function centreOf(eye: Shape): Point {
  const [sumX, sumY] = eye.reduce<Point>(([x, y], point) => [x + point[0], y + point[1]], [0, 0]);
  return [sumX / eye.length, sumY / eye.length];
}

/**
 * Propose the shape of a frame from labeled ones.
 *
 * Each eye by itself: the labeled eye whose picture is found again best, within a third of an eye's width, is laid
 * where it was found; then each point follows its own small patch, held by its neighbors on the lid.
 * Throws RangeError without a labeled frame.
 */
export function proposeShape(picture: Grey, labelled: readonly Labelled[]): Shape {
  const first = labelled[0];
  if (first === undefined) throw new RangeError("expected at least one labelled frame, got none");
  const eyes = Array.from({ length: eyeCount(first.shape) }, (_, eye) => proposeEye(picture, labelled, eye));
  return eyes.flat().map(([x, y]) => [Math.min(picture.width - 0.5, Math.max(-0.5, x)), Math.min(picture.height - 0.5, Math.max(-0.5, y))]);
}

function proposeEye(picture: Grey, labelled: readonly Labelled[], number: number): Shape {
  const matches = labelled.map((source) => {
    const eye = eyeOf(source.shape, number);
    const patch = { columns: EYE_COLUMNS, rows: EYE_ROWS, step: (1.4 * eyeWidth(eye)) / EYE_COLUMNS };
    const centre = centreOf(eye);
    return { source, eye, match: searchFinely(picture, cut(source.picture, centre, patch), centre, patch, EYE_REACH) };
  });
  const best = matches.reduce((a, b) => (b.match.likeness > a.match.likeness ? b : a));
  const laid = best.eye.map(([x, y]): Point => [x + best.match.dx, y + best.match.dy]);
  return refined(picture, best.source.picture, best.eye, laid);
}

/**
 * The corners follow their patches; the lids' points keep their place along the eye and follow theirs across it only.
 * Along a lid one patch looks like the next, and points would slide.
 */
function refined(picture: Grey, before: Grey, labelled: Shape, laid: Shape): Shape {
  const width = eyeWidth(labelled);
  const patch = { columns: POINT_SIDE, rows: POINT_SIDE, step: Math.max(1, 0.018 * width) };
  const follow = (pointIndex: number, from: Point, directions: Directions): Point => {
    const match = searchFinely(picture, cut(before, at(labelled, pointIndex), patch), from, patch, POINT_REACH, directions);
    return match.likeness >= POINT_LEAST ? [match.dx, match.dy] : [0, 0];
  };
  const [first, last] = [at(laid, 0), at(laid, 5)];
  const along: Point = [(last[0] - first[0]) / width, (last[1] - first[1]) / width];
  const [start, end] = [follow(0, first, PLANE), follow(5, last, PLANE)];
  const carried = laid.map(([x, y]): Point => {
    const share = ((x - first[0]) * along[0] + (y - first[1]) * along[1]) / width;
    return [x + start[0] * (1 - share) + end[0] * share, y + start[1] * (1 - share) + end[1] * share];
  });
  const across: Point = [-along[1], along[0]];
  const moves = carried.map((point, index) => (index % 5 === 0 ? ([0, 0] as const) : follow(index, point, [across])));
  return carried.map(([x, y], index): Point => {
    if (index % 5 === 0) return [x, y];
    const [least, most] = index < 5 ? [1, 4] : [6, 8];
    const around = [-1, 0, 1].map((side) => at(moves, Math.min(most, Math.max(least, index + side))));
    return [x + middle(around.map(([dx]) => dx)), y + middle(around.map(([, dy]) => dy))];
  });
}

function middle(values: readonly number[]): number {
  return [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? 0;
}

// The shape a new frame begins with: the template, the nearest labeled frame's, or a proposal from all of them.

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

/** Without a labeled frame: laid on the eyes found, as closed as they are there, or at a fixed place. */
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
