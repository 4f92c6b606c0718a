/** The frames of a trial's clips, decoded as the participant's page decodes them. */
import { BlobSource, CanvasSink, EncodedPacketSink, Input, MP4 } from "mediabunny";
import { decodeClip } from "../../participant/playback/decode";
import type { Clip } from "./shown";

export interface Pictures {
  /** Frame `index`, or a promise of it where it is decoded only now. */
  picture(index: number): CanvasImageSource | Promise<CanvasImageSource | null> | null;
  close(): void;
}

class PicturesProblem extends Error {
  override name = "PicturesProblem";
}

export async function openPictures(clip: Clip): Promise<Pictures> {
  if (!("VideoDecoder" in globalThis)) {
    throw new PicturesProblem("This browser cannot decode clips frame by frame (no WebCodecs). Use a current one, over https.");
  }
  const answer = await fetch(clip.clip_url).catch(() => null);
  if (!answer?.ok) {
    throw new PicturesProblem(`The clip ${clip.cell} ${clip.exemplar} could not be loaded; the log is shown without its pictures.`);
  }
  const bytes = await answer.arrayBuffer();
  const decoded = await decodeClip(bytes, clip.fps);
  if ("bitmaps" in decoded) return allDecoded(decoded.bitmaps);
  decoded.close();
  return LongClip.open(bytes);
}

function allDecoded(bitmaps: readonly ImageBitmap[]): Pictures {
  let kept = bitmaps;
  return {
    picture: (index) => kept[Math.min(index, kept.length - 1)] ?? null,
    close: () => {
      kept = [];
      bitmaps.forEach((bitmap) => bitmap.close());
    },
  };
}

/** Frames to continue decoding over, before starting again at the previous key frame is faster. */
const GO_ON_WITHIN = 60;

/** A clip too long to keep as pictures: decoding continues from the current place, or starts again at the previous key frame. */
class LongClip implements Pictures {
  private frames: AsyncGenerator<{ canvas: CanvasImageSource }, void> | null = null;
  private next = 0;
  private last: { index: number; picture: CanvasImageSource } | null = null;
  private queue: Promise<unknown> = Promise.resolve();
  private isClosed = false;

  private constructor(
    private readonly input: Input,
    private readonly sink: CanvasSink,
    private readonly times: readonly number[],
  ) {}

  static async open(bytes: ArrayBuffer): Promise<LongClip> {
    const input = new Input({ formats: [MP4], source: new BlobSource(new Blob([bytes])) });
    const track = await input.getPrimaryVideoTrack();
    if (!track) throw new PicturesProblem("The clip has no video track.");
    const times: number[] = [];
    for await (const { timestamp } of new EncodedPacketSink(track).packets(undefined, undefined, { metadataOnly: true }))
      times.push(timestamp);
    times.sort((one, other) => one - other);
    return new LongClip(input, new CanvasSink(track), times);
  }

  picture(index: number): CanvasImageSource | Promise<CanvasImageSource | null> {
    if (this.last?.index === index) return this.last.picture;
    const asked = this.queue
      .then(() => this.read(index))
      .catch((reason: unknown) => {
        if (this.isClosed) return null;
        throw reason;
      });
    this.queue = asked.catch(() => {});
    return asked;
  }

  close(): void {
    this.isClosed = true;
    this.frames?.return().catch(() => {});
    this.input.dispose();
  }

  private async read(index: number): Promise<CanvasImageSource | null> {
    if (this.last?.index === index) return this.last.picture;
    if (!this.frames || index < this.next || index > this.next + GO_ON_WITHIN) {
      await this.frames?.return();
      this.frames = this.sink.canvases(this.times[index] ?? 0);
      this.next = index;
    }
    while (this.next <= index) {
      const frame = await this.frames.next();
      if (frame.done) return null;
      this.last = { index: this.next, picture: frame.value.canvas };
      this.next += 1;
    }
    return this.last?.picture ?? null;
  }
}
