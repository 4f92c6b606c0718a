/** A video opened for labelling, with the frames looked at to find unlike ones. */

import { candidateFrames } from "./choose-frames";
import type { Looked } from "./labelled-frames";
import type { OpenedVideo } from "./video";

/** Open a video and look at frames of it; `tell` hears how far that is. */
export async function openForLabelling(file: File, tell: (progress: string) => void): Promise<{ video: OpenedVideo; looked: Looked }> {
  // The readers of video files load when the first one is opened.
  const { openVideo } = await import("./video");
  const video = await openVideo(file);
  try {
    const candidates = candidateFrames(video.frameCount);
    const pictures = await video.thumbnails(candidates, (count) =>
      tell(`Looking for frames unlike one another: ${count} of ${candidates.length}`),
    );
    return { video, looked: { candidates, pictures } };
  } catch (error) {
    video.close();
    throw error;
  }
}
