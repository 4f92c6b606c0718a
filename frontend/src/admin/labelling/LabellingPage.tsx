/** Landmarks on frames of a video, for `stimuli track --labels`. The video stays on this computer. */
import { Alert, Badge, Button, Card, Group, SegmentedControl, Stack, Text, Title } from "@mantine/core";
import { useState } from "react";
import { FEWEST_FRAMES } from "../../labelling/label-file";
import { at } from "../../labelling/points";
import { FRAMES_BEFORE_PROPOSALS } from "../../labelling/propose";
import { ConfirmButton } from "../ui/ConfirmButton";
import { faultOf, type Typed, WholeNumber } from "../ui/WholeNumber";
import { OpenFile } from "./OpenFile";
import { Stage } from "./Stage";
import { useLabelling } from "./useLabelling";
import { useShortcuts, useUnsaved } from "../ui/page-events";
import "./labelling.css";

type Labelling = ReturnType<typeof useLabelling>;

const STARTS = {
  template:
    "This is a starting shape. Drag each point into place. Shift and drag moves the eye, Alt and drag of a corner turns and scales it.",
  eyes: "Placed on the detected eyes. Drag each point into place. Shift and drag moves the eye, Alt and drag of a corner turns and scales it.",
  nearest: `Points of the nearest labeled frame. After ${FRAMES_BEFORE_PROPOSALS} accepted frames, points are proposed.`,
  proposal: "Proposed from the labeled frames. Correct errors, then accept.",
} as const;

const WAITING = "Not accepted yet. Correct errors, then accept. Only accepted frames are saved.";

export function LabellingPage() {
  const work = useLabelling();
  useUnsaved(work.unsaved);
  useKeys(work);
  return (
    <Stack>
      <Title order={1}>Label video</Title>
      <Text maw={720}>
        Mark points around the eyes in about 20 frames, from which <code>stimuli track</code> learns to follow the lids. The video is opened
        in this page only: nothing is uploaded.
      </Text>
      <Group>
        <OpenFile label="Open video" accept="video/*,.mp4,.mov,.webm,.mkv" primary={work.video === null} onOpen={work.open} />
        <OpenFile label="Open labels" accept=".json,application/json" disabled={work.video === null} onOpen={work.openLabels} />
        <Eyes work={work} />
        <Button onClick={work.save} disabled={work.acceptedCount === 0}>
          Save labels
        </Button>
      </Group>
      <div role="status">
        {work.busy === null ? work.notice !== null && <Text size="sm">{work.notice}</Text> : <Text>{work.busy} …</Text>}
      </div>
      {work.problem !== null && (
        <Alert color="red" variant="light" role="alert" title="Look again">
          {work.problem}
        </Alert>
      )}
      {work.video !== null && <Frame work={work} />}
      {work.video !== null && <Frames work={work} />}
      <Keys />
    </Stack>
  );
}

function useKeys(work: Labelling): void {
  const nudge = (dx: number, dy: number) => (event: KeyboardEvent) => {
    if (work.shape === null || work.selected === null) return;
    const far = event.shiftKey ? 10 : 1;
    const [x, y] = at(work.shape, work.selected);
    work.move(work.selected, [x + far * dx, y + far * dy], event.ctrlKey || event.metaKey ? "eye" : "point", null);
  };
  const arrows = { arrowleft: nudge(-1, 0), arrowright: nudge(1, 0), arrowup: nudge(0, -1), arrowdown: nudge(0, 1) };
  useShortcuts({
    ...arrows,
    ...Object.fromEntries(Object.entries(arrows).map(([key, action]) => [`ctrl+${key}`, action])),
    n: () => work.step(1),
    p: () => work.step(-1),
    a: () => {
      if (work.accept()) work.step(1);
    },
    "ctrl+z": work.undo,
    "ctrl+shift+z": work.redo,
    "ctrl+y": work.redo,
  });
}

function Eyes({ work }: { work: Labelling }) {
  return (
    <SegmentedControl
      aria-label="Eyes in the picture"
      value={String(work.eyes)}
      disabled={work.frames.size > 0}
      onChange={(value) => work.setEyes(value === "1" ? 1 : 2)}
      data={[
        { value: "2", label: "Two eyes, 18 points" },
        { value: "1", label: "One eye, 9 points" },
      ]}
    />
  );
}

function Frame({ work }: { work: Labelling }) {
  if (work.video === null) return null;
  const position = work.chosen.indexOf(work.current);
  const frame = work.frames.get(work.current);
  return (
    <Card withBorder>
      <Group justify="space-between" mb="xs">
        <Group gap="xs">
          <Button variant="default" onClick={() => work.step(-1)} disabled={position <= 0}>
            Previous
          </Button>
          <Button variant="default" onClick={() => work.step(1)} disabled={position >= work.chosen.length - 1}>
            Next
          </Button>
          <Text className="number">
            Frame {work.current} of {work.video.frameCount}
          </Text>
          <Badge variant="outline" color="var(--mantine-color-text)">
            {frame?.accepted === true ? "accepted" : "not accepted"}
          </Badge>
        </Group>
        <Group gap="xs">
          <Button variant="default" onClick={work.undo} disabled={!work.canUndo}>
            Undo
          </Button>
          <Button variant="default" onClick={work.redo} disabled={!work.canRedo}>
            Redo
          </Button>
          {frame !== undefined && (
            <ConfirmButton
              label="Remove"
              question={`Remove the points of frame ${work.current}? Undo restores them.`}
              confirm="Remove"
              onConfirm={work.remove}
            />
          )}
          <Button
            onClick={() => {
              if (work.accept()) work.step(1);
            }}
            disabled={work.shape === null}
          >
            Accept
          </Button>
        </Group>
      </Group>
      <Text size="sm" mb="xs" role="status">
        {work.startedFrom === null
          ? frame?.accepted === false
            ? WAITING
            : "You placed the points of this frame."
          : STARTS[work.startedFrom]}
      </Text>
      {work.picture !== null && work.shape !== null && (
        <Stage
          picture={work.picture}
          size={work.video.size}
          shape={work.shape}
          selected={work.selected}
          onSelect={work.select}
          onMove={work.move}
        />
      )}
    </Card>
  );
}

function Frames({ work }: { work: Labelling }) {
  const missing = FEWEST_FRAMES - work.acceptedCount;
  return (
    <Card withBorder>
      <Text mb="xs">
        {work.acceptedCount} of {work.chosen.length} frames accepted.{" "}
        {missing > 0 && `stimuli needs at least ${FEWEST_FRAMES}; about 20 is best. `}
        {work.unsaved && "There is unsaved work."}
      </Text>
      <Group gap={6} role="group" aria-label="Frames to label">
        {work.chosen.map((number) => (
          <Button
            key={number}
            size="compact-sm"
            variant={number === work.current ? "filled" : "default"}
            aria-current={number === work.current}
            aria-label={`Frame ${number}${work.frames.get(number)?.accepted === true ? ", accepted" : ""}`}
            onClick={() => work.goTo(number)}
          >
            {work.frames.get(number)?.accepted === true ? "✓ " : ""}
            {number}
          </Button>
        ))}
      </Group>
      <AddFrame work={work} />
    </Card>
  );
}

/** Frames the choice has missed, such as one in the middle of a blink. */
function AddFrame({ work }: { work: Labelling }) {
  const [number, setNumber] = useState<Typed>("");
  const frames = { min: 0, max: (work.video?.frameCount ?? 1) - 1 };
  return (
    <Group gap="xs" mt="sm" align="end">
      <WholeNumber label="Another frame" w={130} {...frames} optional value={number} onChange={setNumber} />
      <Button variant="default" disabled={faultOf(number, frames) !== null} onClick={() => work.goTo(Number(number))}>
        Add frame
      </Button>
    </Group>
  );
}

function Keys() {
  return (
    <Text size="sm" c="dimmed">
      <kbd>Tab</kbd> next point · arrows 1 px, with <kbd>Shift</kbd> 10 px, with <kbd>Ctrl</kbd> the whole eye · <kbd>A</kbd> accept ·{" "}
      <kbd>N</kbd> <kbd>P</kbd> next, previous frame · <kbd>Ctrl Z</kbd> <kbd>Ctrl Shift Z</kbd> undo, redo · <kbd>+</kbd> <kbd>-</kbd>{" "}
      <kbd>0</kbd> <kbd>E</kbd> zoom in, out, whole frame, eyes
    </Text>
  );
}
