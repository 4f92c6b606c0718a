/** A video opened in the page, frame by frame: nothing of it leaves the browser. */

import { BlobSource, CanvasSink, EncodedPacketSink, Input, MATROSKA, MP4, QTFF, WEBM } from "mediabunny";
import { type Grey, greyOfCanvas } from "./grey";
import type { Size } from "./points";

/** Width of the small pictures: eyes 30 px wide of 640 are 15 there, enough to follow. */
const SMALL_PX = 320;

/** The video cannot be used; the message says why. */
class VideoProblem extends Error {
  override name = "VideoProblem";
}

/** Frames by number: the order in which they are shown, from 0, as `stimuli` counts them. */
export interface OpenedVideo {
  readonly name: string;
  readonly size: Size;
  readonly frameCount: number;
  /** From the first frame to the last. */
  readonly seconds: number;
  frame(number: number): Promise<HTMLCanvasElement>;
  /** Small gray pictures of some frames, numbers ascending. */
  smallPictures(numbers: readonly number[], done: (count: number) => void): Promise<Grey[]>;
  close(): void;
}

export async function openVideo(file: File): Promise<OpenedVideo> {
  const input = new Input({ formats: [MP4, QTFF, WEBM, MATROSKA], source: new BlobSource(file) });
  try {
    return await opened(file.name, input);
  } catch (error) {
    input.dispose();
    if (error instanceof VideoProblem) throw error;
    const reason = error instanceof Error ? error.message : String(error);
    throw new VideoProblem(`${file.name}: not a video that can be read (${reason})`);
  }
}

async function opened(name: string, input: Input): Promise<OpenedVideo> {
  const track = await input.getPrimaryVideoTrack();
  if (track === null) throw new VideoProblem(`${name}: expected a video stream, but the file has none`);
  if (!(await track.canDecode())) {
    throw new VideoProblem(
      `${name}: this browser cannot decode ${(await track.getCodec()) ?? "its codec"}; ` +
        "convert it without loss, for example with ffmpeg -i in -c:v libx264 -crf 0 out.mp4",
    );
  }
  const times = await frameTimes(new EncodedPacketSink(track));
  if (times.length === 0) throw new VideoProblem(`${name}: holds no video frame`);
  // Landmarks count stored pixels, turned upright, as `stimuli` reads them: no stretch to square pixels.
  const turned = (await track.getRotation()) % 180 !== 0;
  const [coded, lines] = [await track.getCodedWidth(), await track.getCodedHeight()];
  const [width, height] = turned ? [lines, coded] : [coded, lines];
  const whole = new CanvasSink(track, { width, height, fit: "fill" });
  const small = new CanvasSink(track, {
    width: Math.min(SMALL_PX, width),
    height: Math.max(1, Math.round((Math.min(SMALL_PX, width) * height) / width)),
    fit: "fill",
    poolSize: 2,
  });
  return {
    name,
    size: [width, height],
    frameCount: times.length,
    seconds: (times[times.length - 1] ?? 0) - (times[0] ?? 0),
    frame: async (number) => copied(await oneFrame(whole, times, number), width, height),
    smallPictures: (numbers, done) =>
      greyFrames(
        small,
        numbers.map((number) => within(times, number)),
        done,
      ),
    close: () => input.dispose(),
  };
}

async function frameTimes(sink: EncodedPacketSink): Promise<number[]> {
  const times: number[] = [];
  for await (const { timestamp } of sink.packets(undefined, undefined, { metadataOnly: true })) {
    // Frames before 0 are cut away by the file's edit list and never shown.
    if (timestamp > -1e-6) times.push(timestamp);
  }
  return times.sort((a, b) => a - b);
}

/** A time inside a frame, clear of its edges: stored times are rounded. */
function within(times: readonly number[], number: number): number {
  const [start, next] = [times[number], times[number + 1]];
  if (start === undefined) throw new VideoProblem(`the video has frames 0 to ${times.length - 1}, not ${number}`);
  return next === undefined ? start + 1e-4 : start + (next - start) / 4;
}

async function oneFrame(sink: CanvasSink, times: readonly number[], number: number): Promise<CanvasImageSource> {
  const frame = await sink.getCanvas(within(times, number));
  if (frame === null) throw new VideoProblem(`frame ${number} cannot be decoded; the file is damaged`);
  return frame.canvas;
}

function copied(picture: CanvasImageSource, width: number, height: number): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  canvas.getContext("2d", { willReadFrequently: true })?.drawImage(picture, 0, 0);
  return canvas;
}

async function greyFrames(sink: CanvasSink, times: readonly number[], done: (count: number) => void): Promise<Grey[]> {
  const pictures: Grey[] = [];
  for await (const frame of sink.canvasesAtTimestamps(times)) {
    if (frame === null) throw new VideoProblem("a frame cannot be decoded; the file is damaged");
    pictures.push(greyOfCanvas(frame.canvas));
    done(pictures.length);
  }
  return pictures;
}
