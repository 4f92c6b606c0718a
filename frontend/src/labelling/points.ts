/** Landmarks of the eyes: 9 points per eye, pixel centers at whole numbers, x right, y down. */

export type Point = readonly [x: number, y: number];
export type Shape = readonly Point[];
export type Size = readonly [width: number, height: number];

export const EYE_POINTS = 9;
export const POINT_ORDER =
  "9 points per eye, image-left eye first: outer canthus, 4 upper-lid points outer to inner, inner canthus, " +
  "3 lower-lid points inner to outer; image-right eye mirrored";

/** One open eye, its canthi at x 0 and 1, in widths of the eye. */
const OPEN_EYE: Shape = [
  [0, 0],
  [0.2, -0.14],
  [0.4, -0.2],
  [0.6, -0.19],
  [0.8, -0.1],
  [1, 0.03],
  [0.75, 0.1],
  [0.5, 0.14],
  [0.25, 0.1],
];

/** One eye, its canthi at x 0 and 1, in widths of the eye; the upper lid brought down to the lower one by a share. */
export function templateEye(closed = 0): Shape {
  const lower: Shape = [at(OPEN_EYE, 0), ...OPEN_EYE.slice(5).reverse()].sort((a, b) => a[0] - b[0]);
  return OPEN_EYE.map(([x, y], index) => {
    if (index === 0 || index >= 5) return [x, y];
    const next = lower.findIndex(([along]) => along > x);
    const [from, to] = [at(lower, next - 1), at(lower, next)];
    const below = from[1] + ((to[1] - from[1]) * (x - from[0])) / (to[0] - from[0]);
    return [x, y + closed * (below - y)];
  });
}

/** A first shape in the middle of the picture: one eye, or two next to each other. */
export function templateShape(eyes: 1 | 2, [width, height]: Size): Shape {
  if (eyes === 1) return OPEN_EYE.map(([x, y]) => [width * (0.2 + 0.6 * x), height / 2 + 0.6 * width * y]);
  const size = 0.13 * width;
  const first = OPEN_EYE.map(([x, y]): Point => [width * 0.3 + size * x, height * 0.45 + size * y]);
  return [...first, ...first.map(([x, y]): Point => [width - 1 - x, y])];
}

/** Points of one eye of a shape. */
export function eyeOf(shape: Shape, eye: number): Shape {
  return shape.slice(EYE_POINTS * eye, EYE_POINTS * (eye + 1));
}

export function eyeCount(shape: Shape): 1 | 2 {
  return shape.length > EYE_POINTS ? 2 : 1;
}

export function at(shape: Shape, index: number): Point {
  const point = shape[index];
  if (point === undefined) throw new RangeError(`expected a point below ${shape.length}, got ${index}`);
  return point;
}

/** Distance between the canthi of one eye, in pixels. */
export function eyeWidth(eye: Shape): number {
  const [a, b] = [at(eye, 0), at(eye, 5)];
  return Math.hypot(b[0] - a[0], b[1] - a[1]);
}

const NAMES = [
  "outer canthus",
  "upper lid 1",
  "upper lid 2",
  "upper lid 3",
  "upper lid 4",
  "inner canthus",
  "lower lid 1",
  "lower lid 2",
  "lower lid 3",
];

/** What a point is, as read aloud: "left eye in the picture, upper lid 2". */
export function pointName(index: number, eyes: 1 | 2): string {
  const name = NAMES[index % EYE_POINTS] ?? "point";
  if (eyes === 1) return name;
  return `${index < EYE_POINTS ? "left" : "right"} eye in the picture, ${name}`;
}

/** The point nearest to a position, no farther away than `reach`; null where none is. */
export function nearestPoint(points: readonly Point[], [x, y]: Point, reach: number): number | null {
  let nearest: number | null = null;
  let least = reach;
  points.forEach(([px, py], index) => {
    const distance = Math.hypot(px - x, py - y);
    if (distance <= least) [nearest, least] = [index, distance];
  });
  return nearest;
}

/** A point held inside the picture. */
export function inside([x, y]: Point, [width, height]: Size): Point {
  return [Math.min(width - 0.5, Math.max(-0.5, x)), Math.min(height - 0.5, Math.max(-0.5, y))];
}

/** A point moved to a place, held inside the picture. */
export function withPoint(shape: Shape, index: number, to: Point, size: Size): Shape {
  return shape.map((point, pointIndex) => (pointIndex === index ? inside(to, size) : point));
}

/** The whole eye of a point moved by as much as that point. */
export function withEyeMoved(shape: Shape, index: number, to: Point, size: Size): Shape {
  const [x, y] = at(shape, index);
  const eye = Math.floor(index / EYE_POINTS);
  return shape.map((point, pointIndex) =>
    Math.floor(pointIndex / EYE_POINTS) === eye ? inside([point[0] + to[0] - x, point[1] + to[1] - y], size) : point,
  );
}

/** The eye of a canthus turned and scaled about its other canthus, so that this one comes to `to`. */
export function withEyeStretched(shape: Shape, index: number, to: Point, size: Size): Shape {
  const first = index - (index % EYE_POINTS);
  if (index !== first && index !== first + 5) return withEyeMoved(shape, index, to, size);
  const [px, py] = at(shape, index === first ? first + 5 : first);
  const [ax, ay] = [at(shape, index)[0] - px, at(shape, index)[1] - py];
  const [bx, by] = [to[0] - px, to[1] - py];
  const norm = ax * ax + ay * ay;
  if (norm === 0 || bx * bx + by * by < 16) return shape;
  const [cosine, sine] = [(ax * bx + ay * by) / norm, (ax * by - ay * bx) / norm];
  return shape.map((point, pointIndex) => {
    if (pointIndex < first || pointIndex >= first + EYE_POINTS) return point;
    const [x, y] = [point[0] - px, point[1] - py];
    return inside([px + cosine * x - sine * y, py + sine * x + cosine * y], size);
  });
}
