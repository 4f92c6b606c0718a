/** Several decoded clips on one canvas, drawn as one: frame k of each in the same refresh. */
import type { DecodedClip } from "./decode";
import type { Part } from "./player";

export interface Composed {
  parts: { clip: DecodedClip; at: Part }[];
  fps: number;
  width: number;
  height: number;
}

/** Throws where a clip is not there, or where frame rates differ: one clock cannot draw those. */
export function composition(
  parts: readonly Part[],
  clipOf: (sha256: string) => DecodedClip | Composed | undefined,
  width: number,
  height: number,
): Composed {
  const decoded = parts.map((at) => {
    const clip = clipOf(at.sha256);
    if (!clip || !("bitmaps" in clip)) throw new Error("expected decoded clips, one of them is not");
    return { clip, at };
  });
  const rates = new Set(decoded.map(({ clip }) => clip.fps));
  const [fps] = rates;
  if (fps === undefined || rates.size > 1) throw new Error(`expected clips of one frame rate, got ${[...rates].join(" and ")} fps`);
  return { parts: decoded, fps, width, height };
}

export function framesOf(clip: DecodedClip | Composed): number {
  return "bitmaps" in clip ? clip.bitmaps.length : Math.max(...clip.parts.map((part) => part.clip.bitmaps.length));
}

interface Canvas {
  readonly canvas: { readonly width: number; readonly height: number };
  drawImage(image: ImageBitmap, x: number, y: number, width: number, height: number): void;
}

/** Draw frame `index` of every clip there; false where one has no such frame. A clip that is over holds its last one. */
export function drawFrame(context: Canvas, clip: DecodedClip | Composed, index: number): boolean {
  const { width, height } = context.canvas;
  const pieces = "bitmaps" in clip ? [{ clip, at: { x: 0, y: 0, width, height } }] : clip.parts;
  const pictures = pieces.map((piece) => piece.clip.bitmaps[Math.min(index, piece.clip.bitmaps.length - 1)]);
  if (pictures.includes(undefined)) return false;
  pieces.forEach(({ at }, place) => {
    const picture = pictures[place];
    if (picture) context.drawImage(picture, at.x, at.y, at.width, at.height);
  });
  return true;
}
