/** Gray pictures, and patches of them that are compared. */
import type { Point } from "./points";

// Gray pictures: what choosing frames and proposing points look at.

export interface Grey {
  readonly width: number;
  readonly height: number;
  /** Luminance, row by row. */
  readonly values: Uint8ClampedArray;
}

/** Luminance (BT.601) of RGBA pixels. */
function greyOf(pixels: { width: number; height: number; data: Uint8ClampedArray }): Grey {
  const values = new Uint8ClampedArray(pixels.width * pixels.height);
  for (let pixel = 0; pixel < values.length; pixel += 1) {
    const [red, green, blue] = [pixels.data[4 * pixel], pixels.data[4 * pixel + 1], pixels.data[4 * pixel + 2]];
    values[pixel] = 0.299 * (red ?? 0) + 0.587 * (green ?? 0) + 0.114 * (blue ?? 0);
  }
  return { width: pixels.width, height: pixels.height, values };
}

/** Gray values of a whole canvas. */
export function greyOfCanvas(canvas: HTMLCanvasElement | OffscreenCanvas): Grey {
  const context: CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D | null = canvas.getContext("2d", {
    willReadFrequently: true,
  });
  if (context === null) throw new Error("this browser gives no canvas to draw in");
  return greyOf(context.getImageData(0, 0, canvas.width, canvas.height));
}

/** Means of squares, row by row. */
export interface BlockMeans {
  readonly across: number;
  readonly down: number;
  readonly values: Float32Array;
}

/** Means of the squares of a picture; what is left over at its right and below is not looked at. */
export function blockMeans({ width, height, values }: Grey, block: number): BlockMeans {
  const [across, down] = [Math.floor(width / block), Math.floor(height / block)];
  const means = new Float32Array(across * down);
  for (let y = 0; y < down * block; y += 1) {
    const row = Math.floor(y / block) * across;
    for (let x = 0; x < across * block; x += 1) {
      const cell = row + Math.floor(x / block);
      means[cell] = (means[cell] ?? 0) + (values[y * width + x] ?? 0);
    }
  }
  for (let cell = 0; cell < means.length; cell += 1) means[cell] = (means[cell] ?? 0) / block ** 2;
  return { across, down, values: means };
}

const THUMBNAIL_PX = 64;

/** The picture about 64 pixels wide, of means of whole squares. */
export function thumbnailOf(picture: Grey): Grey {
  const block = Math.max(1, Math.round(picture.width / THUMBNAIL_PX));
  const { across, down, values } = blockMeans(picture, block);
  return { width: across, height: down, values: Uint8ClampedArray.from(values) };
}

/** Normalized cross-correlation of two samples of equal length: 1 alike up to light and contrast, 0 unrelated. */
function correlation(a: Float64Array, b: Float64Array): number {
  let [sumA, sumB, aa, bb, ab] = [0, 0, 0, 0, 0];
  for (let pixel = 0; pixel < a.length; pixel += 1) {
    const [u, v] = [a[pixel] ?? 0, b[pixel] ?? 0];
    sumA += u;
    sumB += v;
    aa += u * u;
    bb += v * v;
    ab += u * v;
  }
  const spread = (aa - (sumA * sumA) / a.length) * (bb - (sumB * sumB) / a.length);
  return spread > 1e-9 ? (ab - (sumA * sumB) / a.length) / Math.sqrt(spread) : 0;
}

// Patches of pictures: cut out, and found again where another picture looks most like them.

export interface Patch {
  readonly columns: number;
  readonly rows: number;
  readonly step: number;
}

export interface Match {
  readonly dx: number;
  readonly dy: number;
  readonly likeness: number;
}

/** Luminance under a grid of points round a place; the border's beyond it. */
export function cut(picture: Grey, [x, y]: Point, { columns, rows, step }: Patch): Float64Array {
  const { width, values } = picture;
  const out = new Float64Array(columns * rows);
  const lefts = new Int32Array(columns);
  const shares = new Float64Array(columns);
  for (let column = 0; column < columns; column += 1) {
    const at = Math.min(width - 1, Math.max(0, x + (column - (columns - 1) / 2) * step));
    // At the border the last two columns are mixed, all of it from the last.
    const left = Math.max(0, Math.min(width - 2, Math.floor(at)));
    [lefts[column], shares[column]] = [left, at - left];
  }
  const right = width > 1 ? 1 : 0;
  for (let row = 0; row < rows; row += 1) {
    const at = Math.min(picture.height - 1, Math.max(0, y + (row - (rows - 1) / 2) * step));
    const top = Math.max(0, Math.min(picture.height - 2, Math.floor(at)));
    const [share, upper] = [at - top, top * width];
    const lower = upper + (picture.height > 1 ? width : 0);
    for (let column = 0; column < columns; column += 1) {
      const [left, across] = [lefts[column] ?? 0, shares[column] ?? 0];
      const above = (values[upper + left] ?? 0) * (1 - across) + (values[upper + left + right] ?? 0) * across;
      const below = (values[lower + left] ?? 0) * (1 - across) + (values[lower + left + right] ?? 0) * across;
      out[row * columns + column] = above * (1 - share) + below * share;
    }
  }
  return out;
}

/** Directions of a search: both axes of the picture, or one line. */
export type Directions = readonly [Point] | readonly [Point, Point];

export const PLANE: Directions = [
  [1, 0],
  [0, 1],
];

/** The place within `reach` steps of `from` that looks most like `template`. */
function search(
  picture: Grey,
  template: Float64Array,
  from: Point,
  patch: Patch,
  reach: number,
  step: number,
  [first, second]: Directions,
): Match {
  // Where nothing looks more like it, as in an even surface, it stays.
  let best: Match = { dx: 0, dy: 0, likeness: correlation(template, cut(picture, from, patch)) };
  const across = second === undefined ? 0 : reach;
  for (let row = -across; row <= across; row += 1) {
    for (let column = -reach; column <= reach; column += 1) {
      const dx = step * (column * first[0] + row * (second?.[0] ?? 0));
      const dy = step * (column * first[1] + row * (second?.[1] ?? 0));
      const likeness = correlation(template, cut(picture, [from[0] + dx, from[1] + dy], patch));
      if (likeness > best.likeness) best = { dx, dy, likeness };
    }
  }
  return best;
}

/** Coarse to fine: steps of the patch, then half as much down to a fifth of a pixel. */
export function searchFinely(
  picture: Grey,
  template: Float64Array,
  from: Point,
  patch: Patch,
  reach: number,
  directions: Directions = PLANE,
): Match {
  let best = search(picture, template, from, patch, reach, patch.step, directions);
  for (let step = patch.step / 2; step > 0.2; step /= 2) {
    const next = search(picture, template, [from[0] + best.dx, from[1] + best.dy], patch, 1, step, directions);
    best = { dx: best.dx + next.dx, dy: best.dy + next.dy, likeness: next.likeness };
  }
  return best;
}
