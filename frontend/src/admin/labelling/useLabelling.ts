/** The work of the labeling page: a video, its labels with undo, and the start shape of each new frame. */
import { useEffect, useState, useEffectEvent, useCallback } from "react";
import type { OpenedVideo } from "../../labelling/video";
import type { Grey } from "../../labelling/grey";
import { acceptedOf, openForLabelling } from "../../labelling/labelled-frames";
import { type Start, startShape } from "../../labelling/propose";
import {
  type Work,
  atFrame,
  atNeighbour,
  labelFileOf,
  type MoveKind,
  NO_WORK,
  withAccepted,
  withEyes,
  withLabels,
  withMove,
  withoutCurrent,
  withRedo,
  withUndo,
  withVideo,
} from "../../labelling/work";
import { labelsText, parseLabels } from "../../labelling/label-file";
import { noticeOf } from "../../labelling/eyes";
import type { Point, Shape } from "../../labelling/points";
import { downloadText } from "../ui/useChange";
import { mayReplace } from "../ui/page-events";

// The picture of one frame of the opened video, as soon as it is decoded.

interface Picture {
  readonly number: number;
  readonly canvas: HTMLCanvasElement;
}

function message(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

/** Null until the frame `current` of `video` is decoded; if decoding fails, the problem goes to `report`. */
function usePicture(video: OpenedVideo | null, current: number, report: (problem: string) => void): Picture | null {
  const [shown, setShown] = useState<{ video: OpenedVideo; picture: Picture } | null>(null);
  useEffect(() => {
    if (video === null) return;
    let live = true;
    video
      .frame(current)
      .then((canvas) => live && setShown({ video, picture: { number: current, canvas } }))
      .catch((error: unknown) => live && report(message(error)));
    return () => {
      live = false;
    };
  }, [video, current, report]);
  return shown?.video === video && shown.picture.number === current ? shown.picture : null;
}

// The shape that a frame without points begins with, as soon as it is worked out.

interface Begun extends Start {
  readonly video: OpenedVideo;
  readonly eyes: 1 | 2;
}

/** Null for a labeled frame, and until the start of another is known; a failure goes to `report`. */
function useStart({ opened, eyes, history, current }: Work, picture: Picture | null, report: (problem: string) => void): Start | null {
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
      .catch((error: unknown) => live && report(message(error)));
    return () => {
      live = false;
    };
  }, [opened, video, picture, labelled, eyes, report]);
  const fits = start !== null && start.video === video && start.eyes === eyes && start.number === current;
  return fits && !labelled ? start : null;
}

/** Gray pictures of labeled frames, kept as long as their video is open. */
const GREYS = new WeakMap<OpenedVideo, Map<number, Grey>>();

function greysOf(video: OpenedVideo): Map<number, Grey> {
  const kept = GREYS.get(video) ?? new Map<number, Grey>();
  GREYS.set(video, kept);
  return kept;
}

export function useLabelling() {
  const [work, setWork] = useState<Work>(NO_WORK);
  const [busy, setBusy] = useState<string | null>(null);
  const report = useCallback((problem: string | null) => setWork((before) => ({ ...before, problem })), []);
  const video = work.opened?.video ?? null;
  const picture = usePicture(video, work.current, report);
  const start = useStart(work, picture, report);
  const shape = work.history.now.get(work.current)?.shape ?? start?.shape ?? null;
  return {
    ...factsOf(work),
    video,
    busy,
    picture: picture?.canvas ?? null,
    shape,
    startedFrom: start?.from ?? null,
    notice: work.opened === null ? null : noticeOf(work.opened.looked.eyes, work.eyes),
    ...openings(work, setWork, setBusy, report),
    ...edits(work, shape, setWork),
  };
}

function factsOf({ problem, eyes, history, saved, chosen, current, selected }: Work) {
  return {
    problem,
    eyes,
    frames: history.now,
    chosen,
    current,
    selected,
    acceptedCount: acceptedOf(history.now).length,
    unsaved: history.now !== saved,
    canUndo: history.past.length > 0,
    canRedo: history.future.length > 0,
  };
}

type Change = (change: (before: Work) => Work) => void;

function openings(work: Work, change: Change, setBusy: (doing: string | null) => void, report: (problem: string | null) => void) {
  const unsaved = work.history.now !== work.saved;
  const open = async (file: File): Promise<void> => {
    if (!mayReplace(unsaved)) return;
    report(null);
    setBusy("Opening the video");
    try {
      const { video, looked } = await openForLabelling(file, setBusy);
      work.opened?.video.close();
      change((before) => withVideo(before, video, looked));
    } catch (error) {
      report(message(error));
    } finally {
      setBusy(null);
    }
  };
  const openLabels = async (file: File): Promise<void> => {
    if (!mayReplace(unsaved)) return;
    report(null);
    try {
      const next = withLabels(work, file.name, parseLabels(file.name, await file.text()));
      change((before) => (before.opened === work.opened ? next : before));
    } catch (error) {
      report(message(error));
    }
  };
  return { open, openLabels };
}

function edits(work: Work, shape: Shape | null, change: Change) {
  return {
    select: (selected: number | null) => change((before) => ({ ...before, selected })),
    move: (index: number, to: Point, kind: MoveKind, step: string | null): void => {
      if (shape !== null) change((before) => withMove(before, shape, { index, to, kind, step }));
    },
    /** Whether the shown shape could be accepted. */
    accept: (): boolean => {
      if (shape === null) return false;
      change((before) => withAccepted(before, shape));
      return withAccepted(work, shape).problem === null;
    },
    goTo: (number: number) => change((before) => atFrame(before, number)),
    step: (by: 1 | -1) => change((before) => atNeighbour(before, by)),
    save: (): void => {
      const file = labelFileOf(work);
      if (file === null) return;
      downloadText(`${file.video.replace(/\.[^.]+$/, "")}.labels.json`, labelsText(file), "application/json");
      change((before) => ({ ...before, saved: work.history.now }));
    },
    undo: () => change(withUndo),
    redo: () => change(withRedo),
    remove: () => change(withoutCurrent),
    setEyes: (count: 1 | 2) => change((before) => withEyes(before, count)),
  };
}
