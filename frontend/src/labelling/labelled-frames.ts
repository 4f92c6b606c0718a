/** The frames that are labeled: opened from a file, chosen, and kept with their labels. */
import { blockMeans, type Grey, thumbnailOf } from "./grey";
import { type EyesOfVideo, eyesFor, NO_EYES } from "./eyes";
import { checkShape, type LabelFile, LabelProblem } from "./label-file";
import type { Shape } from "./points";
import type { OpenedVideo } from "./video";
import type { FromEyes, ToEyes } from "./eyes-worker";

// Which frames to label: few, and as unlike one another as the recording allows.

const FRAMES_TO_LABEL = 20;
const FEW = 120;
const MANY = 1_200;
/** A closed lid stays for three frames or more at 30 a second. */
const STEP_FRAMES = 3;
/** Pictures before and after that a blink is unlike: 0.4 s at 30 frames a second. */
const ASIDE = 4;
const BLOCK_PX = 4;
const BRIEF_CHANGES = 8;

/** Frame numbers spread evenly over a video, first and last among them: every third, but 120 to 1,200 where it has as many. */
export function candidateFrames(frameCount: number): number[] {
  const count = Math.min(frameCount, Math.max(FEW, Math.min(MANY, Math.ceil((frameCount - 1) / STEP_FRAMES) + 1)));
  if (count < 2) return frameCount > 0 ? [0] : [];
  return Array.from({ length: count }, (_, index) => Math.round((index * (frameCount - 1)) / (count - 1)));
}

/** The most that any square is brighter, or darker, than both a little before and a little after. */
function briefness(before: Float32Array, now: Float32Array, after: Float32Array): number {
  let most = 0;
  for (let block = 0; block < now.length; block += 1) {
    const [since, until] = [(now[block] ?? 0) - (before[block] ?? 0), (now[block] ?? 0) - (after[block] ?? 0)];
    if (since * until > 0) most = Math.max(most, Math.min(Math.abs(since), Math.abs(until)));
  }
  return most;
}

/**
 * Places where a part of the picture changes and is soon as before, as when an eye blinks; the most marked first.
 *
 * Of a few pictures none: there the unlike ones hold the blinks.
 */
export function briefChanges(pictures: readonly Grey[], count = BRIEF_CHANGES): number[] {
  if (pictures.length <= FEW) return [];
  const means = pictures.map((picture) => blockMeans(picture, BLOCK_PX).values);
  const marked = means.map((now, index) => {
    const [before, after] = [means[index - ASIDE], means[index + ASIDE]];
    return before && after ? briefness(before, now, after) : 0;
  });
  const places: number[] = [];
  while (places.length < count) {
    const most = marked.reduce((best, value, index) => (value > (marked[best] ?? 0) ? index : best), 0);
    if (!((marked[most] ?? 0) > 0)) break;
    places.push(most);
    marked.fill(0, Math.max(0, most - ASIDE), most + ASIDE + 1);
  }
  return places;
}

/** Sum of squared differences of two pictures of one size. */
function difference(a: Grey, b: Grey): number {
  let sum = 0;
  for (let pixel = 0; pixel < a.values.length; pixel += 1) {
    sum += ((a.values[pixel] ?? 0) - (b.values[pixel] ?? 0)) ** 2;
  }
  return sum;
}

/**
 * Places of the pictures to take by farthest-point selection: each next one is the least like all taken before.
 *
 * `taken` are places already labeled; without any it begins at the first picture. Pictures equal to a taken one
 * are never taken, so fewer than `count` may come back. In ascending order, `taken` included.
 */
export function farthestPictures(pictures: readonly Grey[], count: number, taken: readonly number[] = []): number[] {
  const chosen = taken.length > 0 ? [...new Set(taken)] : pictures.length > 0 ? [0] : [];
  const nearest = pictures.map(() => Number.POSITIVE_INFINITY);
  const approach = (pictureIndex: number): void => {
    const picture = pictures[pictureIndex];
    if (picture === undefined) return;
    pictures.forEach((other, index) => {
      nearest[index] = Math.min(nearest[index] ?? 0, difference(picture, other));
    });
  };
  chosen.forEach(approach);
  while (chosen.length < count) {
    const farthest = Math.max(...nearest);
    if (!(farthest > 0)) break;
    const pictureIndex = nearest.indexOf(farthest);
    chosen.push(pictureIndex);
    approach(pictureIndex);
  }
  return chosen.sort((a, b) => a - b);
}

// Labeled frames of one video: which to label, and whether labels fit the video.

export interface LabelledFrame {
  readonly shape: Shape;
  readonly accepted: boolean;
}

export type Frames = ReadonlyMap<number, LabelledFrame>;
/** The frames looked at to find unlike ones. */
export interface Looked {
  readonly candidates: readonly number[];
  readonly pictures: readonly Grey[];
  readonly eyes: EyesOfVideo;
}

export function acceptedOf(frames: Frames): [number, Shape][] {
  return [...frames].filter(([, { accepted }]) => accepted).map(([number, { shape }]) => [number, shape]);
}

/** Whether a frame's points are still those that a program proposed: they wait to be accepted. */
export function isProposed({ frames, rest }: LabelFile, number: number): boolean {
  const proposals = new Map(Object.entries(rest["proposed"] ?? {}));
  return JSON.stringify(proposals.get(String(number))) === JSON.stringify(frames.get(number));
}

/** Places of blinks: those of the eyes found, then other brief changes, up to eight. */
function briefPlaces({ pictures, eyes }: Looked, count: 1 | 2): number[] {
  const blinks = (eyesFor(eyes, count)?.blinks ?? []).slice(0, BRIEF_CHANGES);
  const others = briefChanges(pictures).filter((change) => blinks.every((blink) => Math.abs(blink - change) > ASIDE));
  return [...blinks, ...others].slice(0, BRIEF_CHANGES);
}

/** About 20 frames: those labeled, blinks and other brief changes, and ones as unlike these as there are. */
export function chooseFrames(looked: Looked, labelled: readonly number[], eyes: 1 | 2): number[] {
  const { candidates, pictures } = looked;
  const taken = labelled.map((number) =>
    candidates.reduce(
      (best, candidate, index) => (Math.abs(candidate - number) < Math.abs((candidates[best] ?? 0) - number) ? index : best),
      0,
    ),
  );
  const brief = briefPlaces(looked, eyes).slice(0, Math.max(0, FRAMES_TO_LABEL - taken.length));
  // The first picture is an open eye as a rule: without it and labels, only blinks would be known.
  const begun = brief.length > 0 && taken.length === 0 ? [0, ...brief] : [...taken, ...brief];
  const indices = farthestPictures(pictures, FRAMES_TO_LABEL, begun).filter((index) => !taken.includes(index));
  const added = indices.map((index) => candidates[index] ?? 0);
  return [...new Set([...labelled, ...added])].sort((a, b) => a - b);
}

export function requireSameVideo(name: string, labels: LabelFile, video: OpenedVideo): void {
  const [[width, height], [wide, high]] = [labels.size, video.size];
  if (width !== wide || height !== high) {
    throw new LabelProblem(
      `${name}: labels were made on ${width} x ${height} pixels, the video has ${wide} x ${high}; ` + "use the video they were made on",
    );
  }
  const beyond = [...labels.frames.keys()].find((number) => number >= video.frameCount);
  if (beyond === undefined) return;
  throw new LabelProblem(`${name}: frame ${beyond} is labelled, the video ends at frame ${video.frameCount - 1}`);
}

export function problemOf(number: number, shape: Shape, video: OpenedVideo): string | null {
  try {
    checkShape(`frame ${number}`, shape, video.size);
    return null;
  } catch (error) {
    if (error instanceof LabelProblem) return error.message;
    throw error;
  }
}

// A video opened for labeling, with the frames looked at to find unlike ones.

/** Open a video and look at frames of it; `report` receives how far that is. */
export async function openForLabelling(file: File, report: (progress: string) => void): Promise<{ video: OpenedVideo; looked: Looked }> {
  // The readers of video files load when the first one is opened.
  const { openVideo } = await import("./video");
  const video = await openVideo(file);
  try {
    const candidates = candidateFrames(video.frameCount);
    const pictures = await video.smallPictures(candidates, (count) =>
      report(`Looking for varied frames: ${count} of ${candidates.length}`),
    );
    const thumbnails = pictures.map(thumbnailOf);
    const seconds = video.seconds / Math.max(1, candidates.length - 1);
    const eyes = await eyesOf({ pictures, seconds }, (percent) => report(`Looking for eyes that blink: ${percent}%`));
    return { video, looked: { candidates, pictures: thumbnails, eyes } };
  } catch (error) {
    video.close();
    throw error;
  }
}

/** Eyes that blink, looked for in a worker. Without one, labeling goes on from a fixed place. */
function eyesOf(task: ToEyes, report: (percent: number) => void): Promise<EyesOfVideo> {
  if (task.pictures.length < 3 || !(task.seconds > 0)) return Promise.resolve(NO_EYES);
  const worker = new Worker(new URL("./eyes-worker.ts", import.meta.url), { type: "module" });
  return new Promise<EyesOfVideo>((resolve) => {
    worker.onerror = (event) => resolve({ ...NO_EYES, problem: event.message || "their worker stopped" });
    worker.onmessage = ({ data }: MessageEvent<FromEyes>) => {
      if ("percent" in data) report(data.percent);
      else resolve(data.eyes);
    };
    // The pictures are not needed here any more: handed over, they are not copied.
    worker.postMessage(task, [...new Set(task.pictures.map(({ values }) => values.buffer))]);
  }).finally(() => worker.terminate());
}
