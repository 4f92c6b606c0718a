/** A clip's bytes to its frames as pictures: all of them before it is shown, or of a long clip a few ahead. Runs in the worker. */
import { BufferSource, EncodedPacketSink, Input, MP4 } from "mediabunny";
import type { StreamedClip } from "./streamed-clip";

export interface DecodedClip {
  bitmaps: ImageBitmap[];
  fps: number;
  width: number;
  height: number;
}

/** A clip whose frames, four bytes per pixel, take more than this is decoded while it is shown. */
const MAX_KEPT_BYTES = 1 << 28;
const MAX_KEPT_FRAMES = 900;

/** Decode in presentation order. The declared rate counts before the container's. Throws where unreadable. */
export async function decodeClip(bytes: ArrayBuffer, declared_fps: number | null): Promise<DecodedClip | StreamedClip> {
  const input = new Input({ formats: [MP4], source: new BufferSource(bytes) });
  const track = await input.getPrimaryVideoTrack();
  if (!track) throw new Error("expected a video track, found none");
  const config = await track.getDecoderConfig();
  if (!config) throw new Error(`expected a codec this browser knows, got ${(await track.getCodec()) ?? "an unknown one"}`);
  const [width, height] = await Promise.all([track.getDisplayWidth(), track.getDisplayHeight()]);
  // Bitmaps are uncompressed, whatever the clip's bytes: 900 frames of 960 x 360 would take 1.2 GB.
  const kept = Math.min(MAX_KEPT_FRAMES, Math.ceil(MAX_KEPT_BYTES / (4 * width * height)));
  // No more packets are counted than it takes to know.
  const { packetCount, averagePacketRate } = await track.computePacketStats(kept + 1);
  const fps = declared_fps ?? averagePacketRate;
  // Imported only for a long clip: other visits do without the file.
  if (packetCount > kept) return (await import("./streamed-clip")).streamedClip(track, config, fps, width, height);
  const frames = await decodeAll(config, new EncodedPacketSink(track));
  const first = frames[0];
  if (!first) throw new Error("expected at least one frame, got none");
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
      // A decoder that has failed is closed: feeding it further would throw another error and hide the first.
      if (problems.length > 0) break;
      decoder.decode(packet.toEncodedVideoChunk());
    }
    // The decoder reports by a callback; flush() would only say that it is closed.
    if (problems[0]) throw problems[0];
    await decoder.flush();
  } finally {
    if (decoder.state !== "closed") decoder.close();
  }
  const frames = await Promise.all(pending);
  // The pictures become ready in any order, because a separate promise makes each.
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
