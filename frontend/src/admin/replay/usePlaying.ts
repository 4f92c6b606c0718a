/** The playhead of a replay: a moment of the trial, moved by time while it plays. */

import { useEffect, useEffectEvent, useState } from "react";
import type { Folding } from "./folding";

export interface Playing {
  at_ms: number;
  isPlaying: boolean;
  rate: number;
  seek: (at_ms: number) => void;
  setRate: (rate: number) => void;
  toggle: () => void;
}

export function usePlaying(time: Folding, end_ms: number): Playing {
  const [at_ms, setAt] = useState(0);
  const [isPlaying, setPlaying] = useState(false);
  const [rate, setRate] = useState(1);
  const advance = useEffectEvent((by_ms: number): void => {
    const folded = time.fold(at_ms) + by_ms * rate;
    const isOver = folded >= time.length_ms;
    setAt(isOver ? end_ms : time.unfold(folded));
    if (isOver) setPlaying(false);
  });
  useEffect(() => {
    if (!isPlaying) return;
    let before: number | null = null;
    let request = requestAnimationFrame(function tick(now) {
      if (before !== null) advance(now - before);
      before = now;
      request = requestAnimationFrame(tick);
    });
    return () => cancelAnimationFrame(request);
  }, [isPlaying]);
  return {
    at_ms,
    isPlaying,
    rate,
    seek: (moment_ms) => {
      setPlaying(false);
      setAt(Math.min(Math.max(0, moment_ms), end_ms));
    },
    setRate,
    toggle: () => {
      if (!isPlaying && at_ms >= end_ms) setAt(0);
      setPlaying(!isPlaying);
    },
  };
}
