/** The work of the labelling page: a video, its labels with undo, and the start shape of each new frame. */

import { useCallback, useState } from "react";
import { labelsText, parseLabels } from "../../labelling/label-file";
import { acceptedOf } from "../../labelling/labelled-frames";
import { noticeOf } from "../../labelling/eyes";
import { openForLabelling } from "../../labelling/open";
import type { Point, Shape } from "../../labelling/points";
import {
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
  type Work,
} from "../../labelling/work";
import { downloadText } from "../ui/download";
import { mayReplace } from "../ui/useUnsaved";
import { message, usePicture } from "./usePicture";
import { useStart } from "./useStart";

export function useLabelling() {
  const [work, setWork] = useState<Work>(NO_WORK);
  const [busy, setBusy] = useState<string | null>(null);
  const tell = useCallback((problem: string | null) => setWork((before) => ({ ...before, problem })), []);
  const video = work.opened?.video ?? null;
  const picture = usePicture(video, work.current, tell);
  const start = useStart(work, picture, tell);
  const shape = work.history.now.get(work.current)?.shape ?? start?.shape ?? null;
  return {
    ...factsOf(work),
    video,
    busy,
    picture: picture?.canvas ?? null,
    shape,
    startedFrom: start?.from ?? null,
    notice: work.opened === null ? null : noticeOf(work.opened.looked.eyes, work.eyes),
    ...openings(work, setWork, setBusy, tell),
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

function openings(work: Work, change: Change, setBusy: (doing: string | null) => void, tell: (problem: string | null) => void) {
  const unsaved = work.history.now !== work.saved;
  const open = async (file: File): Promise<void> => {
    if (!mayReplace(unsaved)) return;
    tell(null);
    setBusy("Opening the video");
    try {
      const { video, looked } = await openForLabelling(file, setBusy);
      work.opened?.video.close();
      change((before) => withVideo(before, video, looked));
    } catch (error) {
      tell(message(error));
    } finally {
      setBusy(null);
    }
  };
  const openLabels = async (file: File): Promise<void> => {
    if (!mayReplace(unsaved)) return;
    tell(null);
    try {
      const next = withLabels(work, file.name, parseLabels(file.name, await file.text()));
      change((before) => (before.opened === work.opened ? next : before));
    } catch (error) {
      tell(message(error));
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
