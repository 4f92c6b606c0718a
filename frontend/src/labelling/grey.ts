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
