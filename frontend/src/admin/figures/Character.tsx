/** A character that blinks along a closure curve at 30 frames a second, as in a clip without motion blur. */

import { Text, Button, Group, SegmentedControl, Stack, Switch } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { type ReactNode, useEffect, useRef, useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useReducedMotion } from "@mantine/hooks";
import { nearest } from "../../playground/faces";

// From a curve at its own sampling rate to what is shown frame by frame.

/** Closure at each frame of `shownFps`, open before and after; by straight lines between samples. */
export function framesAt(closure: readonly number[], fps: number, shownFps: number): number[] {
  const length = Math.ceil(((closure.length - 1) / fps) * shownFps) + 1;
  const inside = Array.from({ length }, (_, frame) => valueAt(closure, (frame * fps) / shownFps));
  return [0, ...inside, 0];
}

function valueAt(values: readonly number[], position: number): number {
  const last = values.length - 1;
  const before = Math.min(last, Math.floor(position));
  const [left = 0, right = 0] = [values[before], values[Math.min(last, before + 1)]];
  return left + Math.min(1, position - before) * (right - left);
}

// What needs the characters' pictures, once they are known; where they are not made, how to make them.

export const stripAddress = (character: string): string => `/api/admin/blinks/strips/${encodeURIComponent(character)}.webp`;

export function WithStrips({ children }: { children: (strips: Schemas["Strips"]) => ReactNode }) {
  const strips = useQuery({
    queryKey: ["strips"],
    queryFn: () => unwrap(api.GET("/api/admin/blinks/strips")),
    staleTime: Number.POSITIVE_INFINITY,
  });
  if (strips.data === undefined) return null;
  if (strips.data.characters.length > 0) return children(strips.data);
  return (
    <Text size="sm" c="dimmed">
      The characters' pictures are not on this server; <code>make run</code> makes them, or <code>stimuli strips</code>.
    </Text>
  );
}

const FPS = 30;
const REST_MS = 700;

interface Props {
  closure: readonly number[];
  /** The right eye's closure where it has its own. */
  other?: readonly number[];
  /** Samples a second of `closure`. */
  fps: number;
}

export function Character(props: Props) {
  return <WithStrips>{(strips) => <Player {...props} strips={strips} />}</WithStrips>;
}

function Player({ closure, other, fps, strips }: Props & { strips: Schemas["Strips"] }) {
  const [character, setCharacter] = useState(strips.characters.find((name) => name !== "cartoon") ?? strips.characters[0] ?? "");
  const [repeat, setRepeat] = useState(false);
  const [played, setPlayed] = useState(0);
  const picture = usePicture(stripAddress(character));
  const canvas = useRef<HTMLCanvasElement>(null);
  const { width_px: width, height_px: height, closures } = strips;
  const still = useReducedMotion();

  useEffect(() => {
    const drawing = canvas.current?.getContext("2d");
    if (picture === null || drawing == null) return;
    const half = (value: number, left: number) => {
      const top = nearest(closures, value) * height;
      drawing.drawImage(picture, left, top, width / 2, height, left, 0, width / 2, height);
    };
    const frames = framesAt(closure, fps, FPS);
    const others = other === undefined ? frames : framesAt(other, fps, FPS);
    // The character's right eye is at the left of the picture.
    const show = (frame: number) => {
      half(others[frame] ?? 0, 0);
      half(frames[frame] ?? 0, width / 2);
    };
    if (still && played === 0) {
      show(frames.indexOf(Math.max(...frames)));
      return;
    }
    return play(frames.length, repeat, show);
  }, [picture, closure, other, fps, repeat, played, still, closures, width, height]);

  return (
    <Stack gap="xs">
      <canvas
        ref={canvas}
        className="strip"
        width={width}
        height={height}
        role="img"
        aria-label={`The ${character} character playing this blink`}
      />
      <Group gap="sm">
        <Button size="xs" onClick={() => setPlayed(played + 1)}>
          Play
        </Button>
        <Switch size="sm" label="repeat" checked={repeat} onChange={(event) => setRepeat(event.currentTarget.checked)} />
        <SegmentedControl size="xs" aria-label="Character" data={strips.characters} value={character} onChange={setCharacter} />
      </Group>
    </Stack>
  );
}

/** Show each of `count` frames when its time has come; returns what stops it. */
function play(count: number, repeat: boolean, show: (frame: number) => void): () => void {
  const length = (count * 1000) / FPS + REST_MS;
  let [handle, start, drawn] = [0, -1, -1];
  const tick = (now: number) => {
    if (start < 0) start = now;
    const past = repeat ? (now - start) % length : now - start;
    const frame = Math.min(count - 1, Math.floor((past / 1000) * FPS));
    if (frame !== drawn) show(frame);
    drawn = frame;
    if (repeat || frame < count - 1) handle = requestAnimationFrame(tick);
  };
  handle = requestAnimationFrame(tick);
  return () => cancelAnimationFrame(handle);
}

/** The picture at an address, once it is loaded. */
function usePicture(address: string): HTMLImageElement | null {
  const [picture, setPicture] = useState<HTMLImageElement | null>(null);
  useEffect(() => {
    const image = new Image();
    image.src = address;
    let live = true;
    void image.decode().then(
      () => live && setPicture(image),
      () => live && setPicture(null),
    );
    return () => {
      live = false;
    };
  }, [address]);
  return picture;
}
