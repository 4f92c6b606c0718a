/** A clip's bytes to its frames as pictures, all of them, before it is shown. Runs in the worker. */
import { BufferSource, EncodedPacketSink, Input, MP4 } from "mediabunny";

export interface DecodedClip {
  bitmaps: ImageBitmap[];
  fps: number;
  width: number;
  height: number;
}

const LONGEST_CLIP_FRAMES = 900;

/** Decode every frame in presentation order. The declared rate counts before the container's. Throws where unreadable. */
export async function decodeClip(bytes: ArrayBuffer, declared_fps: number | null): Promise<DecodedClip> {
  const input = new Input({ formats: [MP4], source: new BufferSource(bytes) });
  const track = await input.getPrimaryVideoTrack();
  if (!track) throw new Error("expected a video track, found none");
  const config = await track.getDecoderConfig();
  if (!config) throw new Error(`expected a codec this browser knows, got ${(await track.getCodec()) ?? "an unknown one"}`);
  const frames = await decodeAll(config, new EncodedPacketSink(track));
  const first = frames[0];
  if (!first) throw new Error("expected at least one frame, got none");
  const fps = declared_fps ?? (await track.computePacketStats()).averagePacketRate;
  return { bitmaps: frames.map(({ bitmap }) => bitmap), fps, width: first.bitmap.width, height: first.bitmap.height };
}

interface Frame {
  timestamp: number;
  bitmap: ImageBitmap;
}

async function decodeAll(config: VideoDecoderConfig, sink: EncodedPacketSink): Promise<Frame[]> {
  const pending: Promise<Frame>[] = [];
  const problems: DOMException[] = [];
  const decoder = new VideoDecoder({ output: (frame) => pending.push(pictureOf(frame)), error: (error) => problems.push(error) });
  try {
    decoder.configure(config);
    for await (const packet of sink.packets()) {
      if (problems.length > 0) break;
      decoder.decode(packet.toEncodedVideoChunk());
      if (pending.length > LONGEST_CLIP_FRAMES) throw new Error(`expected at most ${LONGEST_CLIP_FRAMES} frames, got more`);
    }
    if (problems[0]) throw problems[0];
    await decoder.flush();
  } finally {
    if (decoder.state !== "closed") decoder.close();
  }
  const frames = await Promise.all(pending);
  return frames.sort((a, b) => a.timestamp - b.timestamp);
}

async function pictureOf(frame: VideoFrame): Promise<Frame> {
  const timestamp = frame.timestamp;
  try {
    return { timestamp, bitmap: await createImageBitmap(frame) };
  } finally {
    // Decoders own few frames; one that is not closed at once stops the decoding.
    frame.close();
  }
}
