/** The participant page's own decoding, for files that a test names: what it makes of each, and how light each frame is. */
import { decodeClip } from "../../src/participant/playback/decode";

export interface Decision {
  problem: string | null;
  frames: number;
  width: number;
  height: number;
  /** Mean gray of each frame, 0 to 255; empty for a clip that is decoded while it is shown. */
  greys: number[];
}

function meanGrey(context: OffscreenCanvasRenderingContext2D, picture: ImageBitmap): number {
  context.drawImage(picture, 0, 0);
  const { data } = context.getImageData(0, 0, picture.width, picture.height);
  let sum = 0;
  for (let at = 1; at < data.length; at += 4) sum += data[at] ?? 0;
  return (4 * sum) / data.length;
}

async function decide(address: string): Promise<Decision> {
  try {
    const clip = await decodeClip(await (await fetch(address)).arrayBuffer(), null);
    const { width, height } = clip;
    if (!("bitmaps" in clip)) return { problem: null, frames: clip.frames, width, height, greys: [] };
    const context = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    if (!context) throw new Error("expected a canvas");
    const greys = clip.bitmaps.map((bitmap) => meanGrey(context, bitmap));
    return { problem: null, frames: clip.bitmaps.length, width, height, greys };
  } catch (error) {
    return { problem: String(error), frames: 0, width: 0, height: 0, greys: [] };
  }
}

Object.assign(globalThis, { decide });
