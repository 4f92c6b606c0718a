/** Grey pictures: what choosing frames and proposing points look at. */

export interface Grey {
  readonly width: number;
  readonly height: number;
  /** Luminance, row by row. */
  readonly values: Uint8ClampedArray;
}

/** Luminance (BT.601) of RGBA pixels. */
export function greyOf(pixels: { width: number; height: number; data: Uint8ClampedArray }): Grey {
  const values = new Uint8ClampedArray(pixels.width * pixels.height);
  for (let place = 0; place < values.length; place += 1) {
    const [red, green, blue] = [pixels.data[4 * place], pixels.data[4 * place + 1], pixels.data[4 * place + 2]];
    values[place] = 0.299 * (red ?? 0) + 0.587 * (green ?? 0) + 0.114 * (blue ?? 0);
  }
  return { width: pixels.width, height: pixels.height, values };
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
  for (let place = 0; place < a.length; place += 1) {
    const [u, v] = [a[place] ?? 0, b[place] ?? 0];
    sumA += u;
    sumB += v;
    aa += u * u;
    bb += v * v;
    ab += u * v;
  }
  const spread = (aa - (sumA * sumA) / a.length) * (bb - (sumB * sumB) / a.length);
  return spread > 1e-9 ? (ab - (sumA * sumB) / a.length) / Math.sqrt(spread) : 0;
}
