/** The shape that a frame without points begins with, as soon as it is worked out. */

import { useEffect, useEffectEvent, useState } from "react";
import type { Grey } from "../../labelling/grey";
import { acceptedOf } from "../../labelling/labelled-frames";
import { type Start, startShape } from "../../labelling/start-shape";
import type { OpenedVideo } from "../../labelling/video";
import type { Work } from "../../labelling/work";
import { message, type Picture } from "./usePicture";

interface Begun extends Start {
  readonly video: OpenedVideo;
  readonly eyes: 1 | 2;
}

/** Null for a labelled frame, and until the start of another is known; one that fails is told to `tell`. */
export function useStart({ opened, eyes, history, current }: Work, picture: Picture | null, tell: (problem: string) => void): Start | null {
  const [start, setStart] = useState<Begun | null>(null);
  const video = opened?.video ?? null;
  const labelled = history.now.has(current);
  // The frames count as they are when a new frame is opened: a start shape does not change under the hand.
  const propose = useEffectEvent((from: NonNullable<Work["opened"]>, shown: Picture) =>
    startShape(from, shown, acceptedOf(history.now), eyes, greysOf(from.video)),
  );
  useEffect(() => {
    if (opened === null || video === null || picture === null || labelled) return;
    let live = true;
    propose(opened, picture)
      .then((proposal) => live && setStart({ ...proposal, video, eyes }))
      .catch((error: unknown) => live && tell(message(error)));
    return () => {
      live = false;
    };
  }, [opened, video, picture, labelled, eyes, tell]);
  const fits = start !== null && start.video === video && start.eyes === eyes && start.number === current;
  return fits && !labelled ? start : null;
}

/** Grey pictures of labelled frames, kept as long as their video is open. */
const GREYS = new WeakMap<OpenedVideo, Map<number, Grey>>();

function greysOf(video: OpenedVideo): Map<number, Grey> {
  const kept = GREYS.get(video) ?? new Map<number, Grey>();
  GREYS.set(video, kept);
  return kept;
}
