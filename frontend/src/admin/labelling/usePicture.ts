/** The picture of one frame of the opened video, as soon as it is decoded. */

import { useEffect, useState } from "react";
import type { OpenedVideo } from "../../labelling/video";

export interface Picture {
  readonly number: number;
  readonly canvas: HTMLCanvasElement;
}

export function message(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

/** Null until the frame `current` of `video` is decoded; a frame that cannot be is told to `tell`. */
export function usePicture(video: OpenedVideo | null, current: number, tell: (problem: string) => void): Picture | null {
  const [shown, setShown] = useState<{ video: OpenedVideo; picture: Picture } | null>(null);
  useEffect(() => {
    if (video === null) return;
    let live = true;
    video
      .frame(current)
      .then((canvas) => live && setShown({ video, picture: { number: current, canvas } }))
      .catch((error: unknown) => live && tell(message(error)));
    return () => {
      live = false;
    };
  }, [video, current, tell]);
  return shown?.video === video && shown.picture.number === current ? shown.picture : null;
}
