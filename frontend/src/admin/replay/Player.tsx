/** One trial played back: the clip, the keys, the time line, and what the log says in words. */

import { useEffect, useState, useEffectEvent, useMemo } from "react";
import type { Pictures } from "./pictures";
import {
  type Clip,
  type Folding,
  answerWords,
  traceOf,
  folding,
  changeBefore,
  changesOf,
  nextChange,
  type Play,
  playedBack,
  shownAt,
} from "./shown";
import { Alert, Button, Group, NumberInput, SegmentedControl, Stack, Text } from "@mantine/core";
import type { Schemas } from "../api";
import { useShortcuts } from "../ui/page-events";
import { arrange } from "./arranging";
import { Stage } from "./Stage";
import { seconds, Timeline, marksOf, ViewFacts } from "./Timeline";

// The decoded clips of a trial, given up with it.

interface Opened {
  pictures: ReadonlyMap<string, Pictures>;
  /** Why a clip has no pictures. */
  problem: string | null;
  isReady: boolean;
}

const NOTHING: Opened = { pictures: new Map(), problem: null, isReady: false };

function usePictures(clips: readonly Clip[]): Opened {
  const [opened, setOpened] = useState<Opened>(NOTHING);
  useEffect(() => {
    let isGone = false;
    let made: [string, Pictures][] = [];
    const close = (): void => made.forEach(([, pictures]) => pictures.close());
    // The video reader is loaded when a replay is opened, not with the page.
    const asked = clips.map(async (clip): Promise<[string, Pictures]> => {
      const { openPictures } = await import("./pictures");
      return [clip.clip_sha256, await openPictures(clip)];
    });
    void Promise.allSettled(asked).then((outcomes) => {
      made = outcomes.flatMap((outcome) => (outcome.status === "fulfilled" ? [outcome.value] : []));
      if (isGone) return close();
      const failed = outcomes.find((outcome) => outcome.status === "rejected");
      setOpened({ pictures: new Map(made), problem: failed ? problemOf(failed.reason) : null, isReady: true });
    });
    return () => {
      isGone = true;
      // Not in an updater of the state: React drops those of a component that goes.
      close();
      setOpened(NOTHING);
    };
  }, [clips]);
  return opened;
}

const problemOf = (reason: unknown): string => (reason instanceof Error ? reason.message : String(reason));

// The playhead of a replay: a moment of the trial, moved by time while it plays.

interface Playing {
  at_ms: number;
  isPlaying: boolean;
  rate: number;
  seek: (at_ms: number) => void;
  setRate: (rate: number) => void;
  toggle: () => void;
}

function usePlaying(time: Folding, end_ms: number): Playing {
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

interface Props {
  replay: Schemas["Replay"];
  trial: Schemas["ReplayedTrial"];
}

const RATES = ["1", "0.5", "0.25", "0.1"];

export function Player({ replay, trial }: Props) {
  const [number, setNumber] = useState(trial.plays[0]?.play ?? 1);
  const { pictures, problem, isReady } = usePictures(trial.clips);
  const play = trial.plays.find((one) => one.play === number);
  if (play === undefined) return <Text>This trial was not reached.</Text>;
  return (
    <Stack>
      {trial.plays.length > 1 && (
        <SegmentedControl
          aria-label="Play"
          value={String(number)}
          onChange={(value) => setNumber(Number(value))}
          data={trial.plays.map((one) => ({ value: String(one.play), label: `Play ${one.play}` }))}
          style={{ alignSelf: "flex-start" }}
        />
      )}
      {problem !== null && (
        <Alert color="yellow" variant="light" role="alert">
          {problem}
        </Alert>
      )}
      <OnePlay key={number} replay={replay} trial={trial} play={play} pictures={pictures} isReady={isReady} />
    </Stack>
  );
}

interface OnePlayProps extends Props {
  play: Play;
  pictures: ReturnType<typeof usePictures>["pictures"];
  isReady: boolean;
}

function OnePlay({ replay, trial, play, pictures, isReady }: OnePlayProps) {
  const made = useMemo(() => {
    const played = playedBack(play, trial.clips);
    const marks = marksOf(play, played, trial.events);
    const end_ms = Math.max(played.end_ms, ...marks.map(({ at_ms }) => at_ms));
    return {
      played,
      marks,
      end_ms,
      time: folding(played.scenes, end_ms),
      changes: changesOf(played),
      trace: traceOf(play, played, replay.trial),
    };
  }, [play, trial, replay]);
  const { played, marks, end_ms, time, changes, trace } = made;
  const playing = usePlaying(time, end_ms);
  const { at_ms, seek, toggle } = playing;
  const back = (): void => seek(changeBefore(changes, at_ms));
  const forth = (): void => seek(nextChange(changes, at_ms));
  useShortcuts({ " ": toggle, arrowleft: back, arrowright: forth });
  // Text that is not whole yet ("12.") comes as such; what is shown is rounded and no seek.
  const typed = (value: string | number): void => {
    const moment = value === "" ? NaN : Number(value);
    if (Number.isFinite(moment) && Math.abs(moment - at_ms) > 0.01) seek(moment);
  };
  const arranged = useMemo(() => arrange(replay, trial.clips, play), [replay, trial, play]);
  const shown = shownAt(played, at_ms);
  const hasLog = played.scenes.some(({ lanes }) => lanes.some(({ shown }) => shown.length > 0));
  return (
    <Stack gap="md">
      {arranged === null ? (
        <Text>An attention check: it has no clip.</Text>
      ) : hasLog ? (
        <Stage arranged={arranged} display={replay.display} pictures={pictures} play={play} shown={shown} at_ms={at_ms} />
      ) : (
        <Text>No frames of this play were logged{play.method === "none" ? ": it was simulated, or nothing was shown" : ""}.</Text>
      )}
      {hasLog && (
        <>
          <Group gap="xs">
            <Button size="xs" variant="default" onClick={back} aria-label="Previous frame">
              ◂ Frame
            </Button>
            <Button size="xs" onClick={toggle} disabled={!isReady} w={72}>
              {playing.isPlaying ? "Pause" : "Play"}
            </Button>
            <Button size="xs" variant="default" onClick={forth} aria-label="Next frame">
              Frame ▸
            </Button>
            <SegmentedControl
              size="xs"
              aria-label="Speed"
              value={String(playing.rate)}
              onChange={(value) => playing.setRate(Number(value))}
              data={RATES.map((rate) => ({ value: rate, label: `× ${rate}` }))}
            />
            <NumberInput
              size="xs"
              w={130}
              aria-label="Time in ms"
              suffix=" ms"
              decimalScale={2}
              hideControls
              value={Math.round(at_ms * 100) / 100}
              onChange={typed}
            />
          </Group>
          <Timeline played={played} time={time} marks={marks} trace={trace} at_ms={at_ms} onSeek={seek} />
          <Text size="xs" c="dimmed">
            Blue: a frame for as long as it was shown. Red: shown too long. Yellow line: frames before it were never drawn. Times count from
            the start key; waits above 1.5 s are drawn as 1.5 s.
          </Text>
        </>
      )}
      <Text>
        Answer: {answerWords(play)}
        {played.answered_ms !== null && `, at ${seconds(played.answered_ms)}`}
        {play.rt !== null && ` (${play.rt.toFixed(0)} ms after the last frame)`}
        {trial.expected_response !== null && `; asked for ${trial.expected_response}`}
        {play.comment !== null && `; remark: ${play.comment}`}
      </Text>
      <ViewFacts play={play} played={played} events={marks} />
    </Stack>
  );
}
