/** Grey pictures: what choosing frames and proposing points look at. */

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

/** Grey values of a whole canvas. */
export function greyOfCanvas(canvas: HTMLCanvasElement | OffscreenCanvas): Grey {
  const context: CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D | null = canvas.getContext("2d", {
    willReadFrequently: true,
  });
  if (context === null) throw new Error("this browser gives no canvas to draw in");
  return greyOf(context.getImageData(0, 0, canvas.width, canvas.height));
}

/** Luminance between pixels; the border's beyond it. */
export function sample({ width, height, values }: Grey, x: number, y: number): number {
  const cx = Math.min(width - 1, Math.max(0, x));
  const cy = Math.min(height - 1, Math.max(0, y));
  const [left, top] = [Math.floor(cx), Math.floor(cy)];
  const [right, below] = [Math.min(width - 1, left + 1), Math.min(height - 1, top + 1)];
  const [fx, fy] = [cx - left, cy - top];
  const upper = (values[top * width + left] ?? 0) * (1 - fx) + (values[top * width + right] ?? 0) * fx;
  const lower = (values[below * width + left] ?? 0) * (1 - fx) + (values[below * width + right] ?? 0) * fx;
  return upper * (1 - fy) + lower * fy;
}

/** Normalised cross-correlation of two samples of equal length: 1 alike up to light and contrast, 0 unrelated. */
export function correlation(a: Float64Array, b: Float64Array): number {
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
