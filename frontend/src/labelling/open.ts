/** A video opened for labelling, with the frames looked at to find unlike ones. */

import { candidateFrames } from "./choose-frames";
import { type EyesOfVideo, NO_EYES } from "./eyes";
import type { FromEyes, ToEyes } from "./eyes-worker";
import { thumbnailOf } from "./grey";
import type { Looked } from "./labelled-frames";
import type { OpenedVideo } from "./video";

/** Open a video and look at frames of it; `tell` hears how far that is. */
export async function openForLabelling(file: File, tell: (progress: string) => void): Promise<{ video: OpenedVideo; looked: Looked }> {
  // The readers of video files load when the first one is opened.
  const { openVideo } = await import("./video");
  const video = await openVideo(file);
  try {
    const candidates = candidateFrames(video.frameCount);
    const pictures = await video.smallPictures(candidates, (count) =>
      tell(`Looking for frames unlike one another: ${count} of ${candidates.length}`),
    );
    const thumbnails = pictures.map(thumbnailOf);
    const seconds = video.seconds / Math.max(1, candidates.length - 1);
    const eyes = await eyesOf({ pictures, seconds }, (percent) => tell(`Looking for eyes that blink: ${percent}%`));
    return { video, looked: { candidates, pictures: thumbnails, eyes } };
  } catch (error) {
    video.close();
    throw error;
  }
}

/** Eyes that blink, looked for in a worker. Without one, labelling goes on from a fixed place. */
function eyesOf(task: ToEyes, tell: (percent: number) => void): Promise<EyesOfVideo> {
  if (task.pictures.length < 3 || !(task.seconds > 0)) return Promise.resolve(NO_EYES);
  const worker = new Worker(new URL("./eyes-worker.ts", import.meta.url), { type: "module" });
  return new Promise<EyesOfVideo>((resolve) => {
    worker.onerror = (event) => resolve({ ...NO_EYES, problem: event.message || "their worker stopped" });
    worker.onmessage = ({ data }: MessageEvent<FromEyes>) => {
      if ("percent" in data) tell(data.percent);
      else resolve(data.eyes);
    };
    // The pictures are not needed here any more: handed over, they are not copied.
    worker.postMessage(task, [...new Set(task.pictures.map(({ values }) => values.buffer))]);
  }).finally(() => worker.terminate());
}
