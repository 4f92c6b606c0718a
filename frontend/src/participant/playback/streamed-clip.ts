/**
 * A long clip: its bytes stay encoded, and only the frames next to be shown are pictures. The decoder is fed as frames
 * are drawn, so that memory does not grow with the length of the clip.
 */
import { EncodedPacketSink, type InputVideoTrack } from "mediabunny";

// Decision 0630: Long clips are decoded a few frames at a time.
/** Frames that the decoder is fed ahead of the one shown: more than an H.264 decoder may hold back (16). */
const AHEAD = 32;
/** Frames that are pictures before the clip may start. */
// A fifth of a second at 60 fps in hand, should the decoder pause just when the clip begins.
const AT_START = 12;
/** As many as the server takes in the log of a view. */
const MAX_FRAMES = 5_000;

/** Open a clip; resolves when its first frames are there. Throws where it cannot be decoded. */
export async function streamedClip(
  track: InputVideoTrack,
  config: VideoDecoderConfig,
  fps: number,
  width: number,
  height: number,
): Promise<StreamedClip> {
  const chunks: EncodedVideoChunk[] = [];
  for await (const packet of new EncodedPacketSink(track).packets()) chunks.push(packet.toEncodedVideoChunk());
  if (chunks.length > MAX_FRAMES) throw new Error(`expected at most ${MAX_FRAMES} frames, got ${chunks.length}`);
  const clip = new StreamedClip(chunks, config, fps, width, height);
  try {
    await clip.rewind();
  } catch (error) {
    clip.close();
    throw error;
  }
  return clip;
}

interface Start {
  ready: Promise<void>;
  resolve: () => void;
  reject: (error: Error) => void;
}

function newStart(): Start {
  const start: Partial<Start> = {};
  const ready = new Promise<void>((resolve, reject) => Object.assign(start, { resolve, reject }));
  return { ...(start as Start), ready };
}

export class StreamedClip {
  /** Why it cannot go on; null while all is well. */
  problem: Error | null = null;
  private readonly ring = new Map<number, ImageBitmap>();
  private decoder: VideoDecoder | null = null;
  private shown = 0;
  private fed = 0;
  private arrived = 0;
  private start: Start | null = null;

  constructor(
    private readonly chunks: readonly EncodedVideoChunk[],
    private readonly config: VideoDecoderConfig,
    readonly fps: number,
    readonly width: number,
    readonly height: number,
  ) {}

  get frames(): number {
    return this.chunks.length;
  }

  /** Frame `index`, undefined where it is not decoded yet. Those before it are given up, and as many more decoded. */
  picture(index: number): ImageBitmap | undefined {
    if (index > this.shown) {
      this.shown = index;
      this.forget(index);
      this.feed();
    }
    return this.ring.get(index);
  }

  /** Be at the first frame; resolves at once where it has not been left, else when the first frames are decoded again. */
  rewind(): Promise<void> {
    // Called after each view and again before the next: the second call finds it done.
    if (this.start && this.shown === 0 && !this.problem) return this.start.ready;
    this.close();
    this.problem = null;
    this.shown = this.fed = this.arrived = 0;
    const start = newStart();
    this.start = start;
    const decoder = new VideoDecoder({
      // With its decoder: frames of one that was closed meanwhile still arrive, and belong to another pass.
      output: (frame) => void this.take(frame, decoder),
      error: (error) => {
        if (decoder === this.decoder) this.fail(error);
      },
    });
    this.decoder = decoder;
    decoder.configure(this.config);
    this.feed();
    return start.ready;
  }

  /** Give up all pictures and the decoder. */
  close(): void {
    this.forget(Infinity);
    if (this.decoder && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
  }

  private feed(): void {
    const { decoder } = this;
    if (decoder?.state !== "configured" || this.fed === this.chunks.length) return;
    for (; this.fed < this.chunks.length && this.fed - this.shown < AHEAD; this.fed += 1) {
      const chunk = this.chunks[this.fed];
      if (chunk) decoder.decode(chunk);
    }
    // The last frames come out only when the decoder knows that they are the last.
    // A rewind closes the decoder, which rejects a flush that is not done yet: nothing is wrong then.
    if (this.fed === this.chunks.length) decoder.flush().catch(() => {});
  }

  /** Frames come in the order of showing: the first is frame 0. */
  private async take(frame: VideoFrame, decoder: VideoDecoder): Promise<void> {
    const index = this.arrived;
    this.arrived += 1;
    try {
      if (decoder !== this.decoder || index < this.shown) return;
      const bitmap = await createImageBitmap(frame);
      // Asked again: the clip may have been rewound while the picture was made.
      if (decoder !== this.decoder || index < this.shown) {
        bitmap.close();
        return;
      }
      this.ring.set(index, bitmap);
      // A clip of fewer frames than AT_START would never begin otherwise.
      if (this.ring.size >= Math.min(AT_START, this.frames)) this.start?.resolve();
    } catch (error) {
      this.fail(error instanceof Error ? error : new Error(String(error)));
    } finally {
      // Decoders own few frames; one that is not closed at once stops the decoding.
      frame.close();
    }
  }

  private fail(error: Error): void {
    this.problem = error;
    this.start?.reject(error);
  }

  private forget(before: number): void {
    for (const [index, bitmap] of this.ring) {
      if (index >= before) continue;
      bitmap.close();
      this.ring.delete(index);
    }
  }
}
