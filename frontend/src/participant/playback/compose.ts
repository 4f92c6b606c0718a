/** Several decoded clips on one canvas, drawn as one: frame k of each in the same refresh. */
import type { DecodedClip } from "./decode";
import type { Part } from "./protocol";
import type { StreamedClip } from "./streamed-clip";

/** One clip, all its frames decoded or those next to be shown. */
export type SingleClip = DecodedClip | StreamedClip;
// Decision 0390: Two clips are one composed clip to the player.
export interface Composed {
  parts: { clip: SingleClip; at: Part }[];
  fps: number;
  width: number;
  height: number;
}

/** Throws where a clip is not there, or where frame rates differ: one clock cannot draw those. */
export function composition(
  parts: readonly Part[],
  clipOf: (sha256: string) => SingleClip | Composed | undefined,
  width: number,
  height: number,
): Composed {
  const decoded = parts.map((at) => {
    const clip = clipOf(at.sha256);
    if (!clip || "parts" in clip) throw new Error("expected decoded clips, one of them is not");
    return { clip, at };
  });
  const rates = new Set(decoded.map(({ clip }) => clip.fps));
  const [fps] = rates;
  if (fps === undefined || rates.size > 1) throw new Error(`expected clips of one frame rate, got ${[...rates].join(" and ")} fps`);
  return { parts: decoded, fps, width, height };
}

const countOf = (clip: SingleClip): number => ("bitmaps" in clip ? clip.bitmaps.length : clip.frames);
const pictureOf = (clip: SingleClip, index: number): ImageBitmap | undefined =>
  "bitmaps" in clip ? clip.bitmaps[index] : clip.picture(index);

export function framesOf(clip: SingleClip | Composed): number {
  // The longest clip decides; shorter ones hold their last frame.
  return "parts" in clip ? Math.max(...clip.parts.map((part) => countOf(part.clip))) : countOf(clip);
}

/** Those of its clips that are decoded while they are shown. */
export function streamsOf(clip: SingleClip | Composed): StreamedClip[] {
  const clips = "parts" in clip ? clip.parts.map((part) => part.clip) : [clip];
  return clips.filter((one): one is StreamedClip => !("bitmaps" in one));
}

interface Canvas {
  readonly canvas: { readonly width: number; readonly height: number };
  drawImage(image: ImageBitmap, x: number, y: number, width: number, height: number): void;
}

/** Draw frame `index` of every clip there; false where one has no such frame. A clip that is over holds its last one. */
export function drawFrame(context: Canvas, clip: SingleClip | Composed, index: number): boolean {
  const { width, height } = context.canvas;
  const pieces = "parts" in clip ? clip.parts : [{ clip, at: { x: 0, y: 0, width, height } }];
  const pictures = pieces.map((piece) => pictureOf(piece.clip, Math.min(index, countOf(piece.clip) - 1)));
  // All or none: clips that are compared must never be a frame apart.
  if (pictures.includes(undefined)) return false;
  pieces.forEach(({ at }, pieceIndex) => {
    const picture = pictures[pieceIndex];
    if (picture) context.drawImage(picture, at.x, at.y, at.width, at.height);
  });
  return true;
}
