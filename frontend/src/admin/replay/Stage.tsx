/** The clip as it was on the participant's screen, alone or at its place in the window. */

import { drawSyncPatch } from "../../participant/playback/sync-patch";
import type { Schemas } from "../api";
import { type Arranged, topOf, windowOf } from "./arranging";
import type { Pictures } from "./pictures";
import type { Shown, Play } from "./shown";
import { Box, SegmentedControl, Stack, Text } from "@mantine/core";
import { useEffect, useRef, useState } from "react";
import { fixed } from "../ui/format";

// What the canvas showed at a moment: the surround, and on it each clip's frame at its place.

interface Painted {
  canvas: HTMLCanvasElement;
  arranged: Arranged;
  pictures: ReadonlyMap<string, Pictures>;
  display: Schemas["Display"];
}

/** Paint a moment; resolves once it is painted. `current` says whether it is still the requested one. */
async function paint({ canvas, arranged, pictures, display }: Painted, { frames }: Shown, current: () => boolean): Promise<void> {
  const context = canvas.getContext("2d", { alpha: false });
  if (!context) return;
  const sources = frames.map(({ lane, frame }) => pictures.get(lane.sha256)?.picture(frame.index) ?? null);
  // Without a wait where everything is decoded: the picture and its time change together.
  const ready: (CanvasImageSource | null)[] = [];
  for (const source of sources) ready.push(source instanceof Promise ? await source : source);
  if (!current()) return;
  context.fillStyle = display.background;
  context.fillRect(0, 0, canvas.width, canvas.height);
  frames.forEach(({ lane }, row) => {
    const { x, y, width, height } = arranged.boxOf(lane.role);
    const picture = ready[row];
    if (picture) context.drawImage(picture, x, y, width, height);
  });
  if (display.sync_patch) drawSyncPatch(context, frames.length ? Math.max(...frames.map(({ frame }) => frame.index)) : null);
}

interface Props {
  arranged: Arranged;
  display: Schemas["Display"];
  pictures: ReadonlyMap<string, Pictures>;
  play: Play;
  shown: Shown;
  at_ms: number;
}

type Around = "clip" | "window";

export function Stage({ arranged, display, pictures, play, shown, at_ms }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [around, setAround] = useState<Around>("clip");
  const window_px = windowOf(play);
  useEffect(() => {
    let isCurrent = true;
    const target = canvas.current;
    if (target === null) return;
    void paint({ canvas: target, arranged, pictures, display }, shown, () => isCurrent).then(() => {
      if (isCurrent) target.dataset["paintedMs"] = String(at_ms);
    });
    return () => {
      isCurrent = false;
    };
  });
  const { width, height } = arranged.shown;
  const inWindow = around === "window" && window_px !== null;
  const frame = inWindow ? window_px : { width, height };
  const top = inWindow ? topOf(frame.height, height) : 0;
  return (
    <Stack gap="xs">
      <Box
        className="replay-window"
        style={{ background: display.background, maxInlineSize: frame.width, aspectRatio: frame.width / frame.height }}
      >
        <canvas
          ref={canvas}
          width={arranged.canvas.width}
          height={arranged.canvas.height}
          role="img"
          aria-label={labelOf(shown)}
          style={{
            inlineSize: `${(100 * width) / frame.width}%`,
            insetInlineStart: `${(50 * (frame.width - width)) / frame.width}%`,
            insetBlockStart: `${(100 * top) / frame.height}%`,
          }}
        />
      </Box>
      {window_px !== null && (
        <SegmentedControl
          size="xs"
          aria-label="What is around the clip"
          value={around}
          onChange={(value) => setAround(value)}
          data={[
            { value: "clip", label: "The clip alone" },
            { value: "window", label: "In their window" },
          ]}
          style={{ alignSelf: "flex-start" }}
        />
      )}
      <Text size="sm" c="dimmed">
        {sizeWords(arranged, play)}
      </Text>
    </Stack>
  );
}

function labelOf({ frames }: Shown): string {
  const labels = frames.map(({ lane, frame }) => `${lane.role === "shown" ? "" : `${lane.role}: `}frame ${frame.index}`);
  return labels.length > 0 ? `On their screen: ${labels.join(", ")}` : "On their screen: the surround, no clip";
}

/** How large the clip was there; in mm where the screen was measured. */
function sizeWords({ shown }: Arranged, play: Play): string {
  const { width, height } = shown;
  const window_px = windowOf(play);
  const mm = play.px_per_mm === null ? "" : `, ${fixed(width / play.px_per_mm, 0)} × ${fixed(height / play.px_per_mm, 0)} mm`;
  const around = window_px === null ? "" : `, in a window of ${window_px.width} × ${window_px.height}`;
  const refresh = play.refresh_rate_hz === null ? "" : `, on a screen of ${fixed(play.refresh_rate_hz, 1)} Hz`;
  return `There ${fixed(width, 0)} × ${fixed(height, 0)} CSS px${mm}${around}${refresh}.`;
}
