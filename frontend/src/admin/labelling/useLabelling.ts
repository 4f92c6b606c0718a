/** The work of the labelling page: a video, its labels with undo, and the start shape of each new frame. */

import { useCallback, useEffect, useEffectEvent, useRef, useState } from "react";
import { candidateFrames } from "../../labelling/choose-frames";
import type { Grey } from "../../labelling/grey";
import { begun, changed, type History, redone, undone } from "../../labelling/history";
import { defaultMarkers, type LabelFile, labelsText, parseLabels } from "../../labelling/label-file";
import {
  acceptedOf,
  chooseFrames,
  type Frames,
  type LabelledFrame,
  type Looked,
  problemOf,
  requireSameVideo,
} from "../../labelling/labelled-frames";
import { type Point, withEyeMoved, withEyeStretched, withPoint } from "../../labelling/points";
import { type Start, startShape } from "../../labelling/start-shape";
import type { OpenedVideo } from "../../labelling/video";
import { downloadText } from "../ui/download";
import type { MoveKind } from "./Stage";
import { message, type Picture, usePicture } from "./usePicture";

type Markers = Pick<LabelFile, "midUpper" | "midLower" | "rest">;

const NOTHING: Frames = new Map();
export function useLabelling() {
  const [video, setVideo] = useState<OpenedVideo | null>(null);
  const [busy, setBusy] = useState<string | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [eyes, setEyes] = useState<1 | 2>(2);
  const [markers, setMarkers] = useState<Markers>({ ...defaultMarkers(2), rest: {} });
  const [history, setHistory] = useState<History<Frames>>(begun(NOTHING));
  const [saved, setSaved] = useState<Frames>(NOTHING);
  const [looked, setLooked] = useState<Looked | null>(null);
  const [chosen, setChosen] = useState<readonly number[]>([]);
  const [current, setCurrent] = useState(0);
  const picture = usePicture(video, current, setProblem);
  const [start, setStart] = useState<Start | null>(null);
  const [selected, setSelected] = useState<number | null>(null);
  const greys = useRef(new Map<number, Grey>());
  const frames = history.now;

  const begin = useCallback((next: Frames, count: 1 | 2, kept: Markers) => {
    setEyes(count);
    setMarkers(kept);
    setHistory(begun(next));
    setSaved(next);
    setStart(null);
    setSelected(null);
  }, []);

  const open = async (file: File): Promise<void> => {
    setProblem(null);
    setBusy("Opening the video");
    try {
      // The readers of video files load when the first one is opened.
      const { openVideo } = await import("../../labelling/video");
      const next = await openVideo(file);
      const candidates = candidateFrames(next.frameCount);
      const pictures = await next.thumbnails(candidates, (count) =>
        setBusy(`Looking for frames unlike one another: ${count} of ${candidates.length}`),
      );
      const samples = { candidates, pictures };
      const numbers = chooseFrames(samples, []);
      video?.close();
      greys.current.clear();
      setVideo(next);
      setLooked(samples);
      setChosen(numbers);
      setCurrent(numbers[0] ?? 0);
      begin(NOTHING, eyes, { ...defaultMarkers(eyes), rest: {} });
    } catch (error) {
      setProblem(message(error));
    } finally {
      setBusy(null);
    }
  };

  const openLabels = async (file: File): Promise<void> => {
    if (video === null || looked === null) return;
    setProblem(null);
    try {
      const labels = parseLabels(file.name, await file.text());
      requireSameVideo(file.name, labels, video);
      const numbers = chooseFrames(looked, [...labels.frames.keys()]);
      const { midUpper, midLower, rest } = labels;
      begin(new Map([...labels.frames].map(([number, shape]) => [number, { shape, accepted: true }])), labels.eyes, {
        midUpper,
        midLower,
        rest,
      });
      setChosen(numbers);
      setCurrent([...labels.frames.keys()][0] ?? numbers[0] ?? 0);
    } catch (error) {
      setProblem(message(error));
    }
  };

  const labelled = frames.has(current);
  // The frames count as they are when a new frame is opened: a start shape does not change under the hand.
  const propose = useEffectEvent((opened: OpenedVideo, shownPicture: Picture) =>
    startShape(opened, shownPicture, acceptedOf(frames), eyes, greys.current),
  );
  useEffect(() => {
    if (video === null || picture === null || labelled) return;
    let live = true;
    propose(video, picture)
      .then((proposal) => live && setStart(proposal))
      .catch((error: unknown) => live && setProblem(message(error)));
    return () => {
      live = false;
    };
  }, [video, picture, current, labelled, eyes]);

  const shown = frames.get(current)?.shape ?? (start?.number === current ? start.shape : null);
  const put = (frame: LabelledFrame, step: string | null = null): void =>
    setHistory((before) => changed(before, new Map(before.now).set(current, frame), step));

  const move = (index: number, to: Point, kind: MoveKind, step: string | null): void => {
    if (shown === null || video === null) return;
    const moved = { point: withPoint, eye: withEyeMoved, stretch: withEyeStretched }[kind](shown, index, to, video.size);
    const wrong = problemOf(current, moved, video);
    put({ shape: moved, accepted: (frames.get(current)?.accepted ?? false) && wrong === null }, step);
    setProblem(wrong);
  };

  const accept = (): boolean => {
    if (shown === null || video === null) return false;
    const wrong = problemOf(current, shown, video);
    setProblem(wrong);
    if (wrong === null) put({ shape: shown, accepted: true });
    return wrong === null;
  };

  const goTo = (number: number): void => {
    if (video === null) return;
    const frameNumber = Math.max(0, Math.min(video.frameCount - 1, number));
    setChosen((before) => (before.includes(frameNumber) ? before : [...before, frameNumber].sort((a, b) => a - b)));
    setCurrent(frameNumber);
    setProblem(null);
  };

  const step = (by: 1 | -1): void => {
    const next = chosen[chosen.indexOf(current) + by];
    if (next !== undefined) goTo(next);
  };

  const save = (): void => {
    if (video === null) return;
    const kept = new Map(acceptedOf(frames));
    const file = { video: video.name, size: video.size, eyes, ...markers, frames: kept };
    downloadText(`${video.name.replace(/\.[^.]+$/, "")}.labels.json`, labelsText(file), "application/json");
    setSaved(frames);
  };

  return {
    video,
    busy,
    problem,
    eyes,
    frames,
    chosen,
    current,
    picture: picture?.canvas ?? null,
    shape: shown,
    startedFrom: labelled || start?.number !== current ? null : start.from,
    selected,
    acceptedCount: acceptedOf(frames).length,
    unsaved: frames !== saved,
    canUndo: history.past.length > 0,
    canRedo: history.future.length > 0,
    open,
    openLabels,
    select: setSelected,
    move,
    accept,
    goTo,
    step,
    save,
    undo: () => {
      setProblem(null);
      setHistory(undone);
    },
    redo: () => {
      setProblem(null);
      setHistory(redone);
    },
    remove: () => {
      const rest = new Map(frames);
      if (rest.delete(current)) setHistory((before) => changed(before, rest));
    },
    setEyes: (count: 1 | 2) => begin(NOTHING, count, { ...defaultMarkers(count), rest: {} }),
  };
}
