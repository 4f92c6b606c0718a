/** Label files as `stimuli track --labels` reads them: read, check with the same rules and words, write. */

import { at, EYE_POINTS, eyeOf, eyeWidth, POINT_ORDER, type Point, type Shape, type Size } from "./points";

export const FEWEST_FRAMES = 3;
const ORDER_TOLERANCE = 0.06;
const CROSSING_TOLERANCE = 0.12;

/** What is wrong with a label file or a shape, in one line. */
export class LabelProblem extends Error {
  override name = "LabelProblem";
}

export interface LabelFile {
  video: string | null;
  size: Size;
  eyes: 1 | 2;
  /** Per eye the points whose mean is the lid marker. */
  midUpper: readonly (readonly number[])[];
  midLower: readonly (readonly number[])[];
  frames: ReadonlyMap<number, Shape>;
  /** Keys this page does not know; kept as they are. */
  rest: Readonly<Record<string, unknown>>;
}

export function defaultMarkers(eyes: 1 | 2): Pick<LabelFile, "midUpper" | "midLower"> {
  const starts = eyes === 1 ? [0] : [0, EYE_POINTS];
  return { midUpper: starts.map((start) => [start + 2, start + 3]), midLower: starts.map((start) => [start + 7]) };
}

/** Read a label file. A file with fewer frames than `stimuli` needs is taken: it is work begun. */
export function parseLabels(name: string, text: string): LabelFile {
  const document = objectOf(name, text);
  const size = sizeOf(name, document["image_size_px"]);
  const frames = framesOf(name, document["frames"]);
  const counts = [...new Set([...frames.values()].map((shape) => shape.length))].sort((a, b) => a - b);
  if (counts.length > 1) {
    throw new LabelProblem(`${name}: some frames have ${counts[0]} points and some ${counts[1]}; label all alike`);
  }
  const eyes = counts[0] === EYE_POINTS ? 1 : 2;
  for (const [number, shape] of frames) checkShape(`${name}: frame ${number}`, shape, size);
  const known = new Set(["video", "image_size_px", "mid_upper", "mid_lower", "frames", "point_order"]);
  return {
    video: typeof document["video"] === "string" ? document["video"] : null,
    size,
    eyes,
    midUpper: markersOf(name, document, "mid_upper", eyes),
    midLower: markersOf(name, document, "mid_lower", eyes),
    frames,
    rest: Object.fromEntries(Object.entries(document).filter(([key]) => !known.has(key))),
  };
}

function objectOf(name: string, text: string): Record<string, unknown> {
  let parsed: unknown;
  try {
    parsed = JSON.parse(text);
  } catch (error) {
    throw new LabelProblem(`${name}: not a label file in JSON (${error instanceof Error ? error.message : String(error)})`);
  }
  if (typeof parsed !== "object" || parsed === null || Array.isArray(parsed)) {
    throw new LabelProblem(`${name}: expected a JSON object with 'image_size_px' and 'frames'`);
  }
  return Object.fromEntries(Object.entries(parsed));
}

function sizeOf(name: string, sizeValue: unknown): Size {
  const sides: unknown[] = Array.isArray(sizeValue) ? sizeValue : [];
  const [width, height] = sides;
  if (sides.length === 2 && isWhole(width) && isWhole(height) && width > 0 && height > 0) return [width, height];
  throw new LabelProblem(`${name}: expected 'image_size_px': [width, height], found ${JSON.stringify(sizeValue)}`);
}

function isWhole(value: unknown): value is number {
  return typeof value === "number" && Number.isInteger(value);
}

function framesOf(name: string, frameTable: unknown): Map<number, Shape> {
  if (typeof frameTable !== "object" || frameTable === null || Array.isArray(frameTable)) {
    throw new LabelProblem(`${name}: expected 'frames': {frame number: points}`);
  }
  const frames = new Map<number, Shape>();
  for (const [key, points] of Object.entries(frameTable)) {
    if (!/^\s*\d+\s*$/.test(key)) throw new LabelProblem(`${name}: expected a frame number from 0, found '${key}'`);
    const number = Number(key);
    if (frames.has(number)) {
      throw new LabelProblem(`${name}: frame ${number} occurs twice; keep one set of points for each frame`);
    }
    frames.set(number, shapeOf(`${name}: frame ${number}`, points));
  }
  return new Map([...frames].sort(([a], [b]) => a - b));
}

function shapeOf(where: string, pointList: unknown): Shape {
  const points: unknown[] = Array.isArray(pointList) ? pointList : [];
  if (points.length !== EYE_POINTS && points.length !== 2 * EYE_POINTS) {
    const count = Array.isArray(pointList) ? points.length : "no list of";
    throw new LabelProblem(`${where}: expected 18 points (or 9 for one eye), found ${count}`);
  }
  return points.map((point, index): Point => {
    const pair: unknown[] = Array.isArray(point) ? point : [];
    const [x, y] = pair;
    if (pair.length === 2 && typeof x === "number" && typeof y === "number") return [x, y];
    throw new LabelProblem(`${where}: point ${index + 1} is ${JSON.stringify(point)}, expected [x, y] in pixels`);
  });
}

function markersOf(name: string, document: Record<string, unknown>, key: string, eyes: 1 | 2): number[][] {
  const fallback = key === "mid_upper" ? defaultMarkers(eyes).midUpper : defaultMarkers(eyes).midLower;
  const given: unknown = document[key] ?? fallback;
  if (!Array.isArray(given) || given.length !== eyes) {
    throw new LabelProblem(`${name}: expected '${key}' with one list of points for each of ${eyes} eyes`);
  }
  return given.map((list: unknown, eye) => {
    const points: unknown[] = Array.isArray(list) ? list : [];
    const [first, end] = [EYE_POINTS * eye, EYE_POINTS * (eye + 1)];
    const valid = points.filter((point) => isWhole(point)).filter((point) => point >= first && point < end);
    if (valid.length > 0 && valid.length === points.length) return valid;
    throw new LabelProblem(`${name}: '${key}' names ${JSON.stringify(list)}, expected points ${first} to ${end - 1}`);
  });
}

/** Refuse a shape that `stimuli` would refuse: outside the picture, eyes swapped, an outline that crosses itself. */
export function checkShape(where: string, shape: Shape, size: Size): void {
  const outside = shape.findIndex(([x, y]) => !(x >= -0.5 && y >= -0.5 && x <= size[0] - 0.5 && y <= size[1] - 0.5));
  if (outside >= 0) {
    const [x, y] = at(shape, outside).map((value) => Number(value.toPrecision(6)));
    throw new LabelProblem(`${where}: point ${outside + 1} at (${x}, ${y}) is outside the picture of ${size[0]} x ${size[1]}`);
  }
  const eyes = shape.length / EYE_POINTS;
  const centres = Array.from({ length: eyes }, (_, eye) => eyeOf(shape, eye).reduce((sum, [x]) => sum + x, 0));
  if ((centres[0] ?? 0) > (centres[1] ?? Number.POSITIVE_INFINITY)) {
    throw new LabelProblem(`${where}: the eyes are swapped; points 1 to 9 belong to the image-left eye`);
  }
  for (let eye = 0; eye < eyes; eye += 1) checkEye(where, eyeOf(shape, eye), EYE_POINTS * eye);
}

/** One eye's points along and below the line of its canthi, in widths of the eye; x grows towards point 6. */
function straightened(eye: Shape): Point[] {
  const [first, last] = [at(eye, 0), at(eye, 5)];
  const width = eyeWidth(eye);
  const side = last[0] < first[0] ? -1 : 1;
  const [ax, ay] = [(side * (last[0] - first[0])) / width, (side * (last[1] - first[1])) / width];
  const flat = eye.map(([x, y]): Point => {
    const [dx, dy] = [(x - first[0]) / width, (y - first[1]) / width];
    return [dx * ax + dy * ay, dy * ax - dx * ay];
  });
  const sign = at(flat, 5)[0] > 0 ? 1 : -1;
  return flat.map(([x, y]) => [sign * x, y]);
}

function checkEye(where: string, eye: Shape, first: number): void {
  if (eyeWidth(eye) < 4) {
    throw new LabelProblem(`${where}: canthi ${first + 1} and ${first + 6} are less than 4 px apart; label a larger eye`);
  }
  const flat = straightened(eye);
  const outline = [0, 1, 2, 3, 4, 5, 6, 7, 8, 0];
  outline.slice(1).forEach((to, index) => {
    const from = outline[index] ?? 0;
    const step = (at(flat, to)[0] - at(flat, from)[0]) * (index < 5 ? 1 : -1);
    if (step < -ORDER_TOLERANCE) {
      throw new LabelProblem(`${where}: points ${first + from + 1} and ${first + to + 1} cross; check the point order`);
    }
  });
  const upper = flat.slice(0, 6).sort(([a], [b]) => a - b);
  for (const lower of [6, 7, 8]) {
    const [x, y] = at(flat, lower);
    if (heightAt(upper, x) - y > CROSSING_TOLERANCE) {
      throw new LabelProblem(`${where}: lower-lid point ${first + lower + 1} lies above the upper lid; they cross`);
    }
  }
}

/** Height of a polyline, its points in order of x, at a place; flat beyond its ends. */
function heightAt(line: readonly Point[], x: number): number {
  const next = line.findIndex((point) => point[0] >= x);
  if (next <= 0) return at(line, next === 0 ? 0 : line.length - 1)[1];
  const [a, b] = [at(line, next - 1), at(line, next)];
  return b[0] === a[0] ? b[1] : a[1] + ((x - a[0]) / (b[0] - a[0])) * (b[1] - a[1]);
}

/** The text of a label file; points to 0.001 px. */
export function labelsText(file: LabelFile): string {
  const frames = [...file.frames]
    .sort(([a], [b]) => a - b)
    .map(([number, shape]) => [String(number), shape.map((point) => point.map((v) => Math.round(v * 1000) / 1000))]);
  const document = {
    video: file.video,
    image_size_px: file.size,
    ...file.rest,
    point_order: POINT_ORDER,
    mid_upper: file.midUpper,
    mid_lower: file.midLower,
    frames: Object.fromEntries(frames) as unknown,
  };
  return `${JSON.stringify(document, null, 1)}\n`;
}
