/** The cells of a study of own clips, each with its clips: dragged, or chosen and put by keyboard; filled from file names. */

import { Alert, Button, Group, Select, Stack, Text, TextInput } from "@mantine/core";
import { useInViewport } from "@mantine/hooks";
import { type KeyboardEvent, useEffect, useMemo, useRef, useState } from "react";
import { UploadClips } from "../clips/UploadClips";
import { playNeeded, useUpload } from "../clips/useUpload";
import { declaredPattern, fieldsOf, levelsByPattern } from "../studies/file-pattern";
import { useDropTarget } from "../ui/DropZone";
import { counted } from "../ui/format";
import { type Data, listAt, textAt } from "./data";
import {
  arrangementOf,
  designOfTyped,
  factorsOf,
  filledByPattern,
  filledInOrder,
  isClip,
  type NewCells,
  type Place,
  reconciled,
  type Slot,
  type TypedFactor,
  uploadedPlaces,
  withMoved,
} from "./places";
import { useBuilderHere } from "./useBuilder";

// The first frame of a clip, drawn once: one video at a time, so that hundreds of clips need one decoder.

const THUMB_PX = 160;
const GIVEN_UP_MS = 5_000;
const frames = new Map<string, Promise<ImageBitmap | null>>();
let queue: Promise<unknown> = Promise.resolve();

function firstFrame(address: string): Promise<ImageBitmap | null> {
  const known = frames.get(address);
  if (known !== undefined) return known;
  const drawn = queue.then(() => drawFrame(address)).catch(() => null);
  queue = drawn;
  frames.set(address, drawn);
  return drawn;
}

async function drawFrame(address: string): Promise<ImageBitmap | null> {
  const video = document.createElement("video");
  video.muted = true;
  video.preload = "auto";
  const isThere = await new Promise<boolean>((resolve) => {
    video.onloadeddata = () => resolve(true);
    video.onerror = () => resolve(false);
    setTimeout(() => resolve(false), GIVEN_UP_MS);
    video.src = address;
  });
  const frame = isThere ? await createImageBitmap(video, { resizeWidth: THUMB_PX, resizeQuality: "medium" }) : null;
  video.removeAttribute("src");
  video.load();
  return frame;
}

const addressOf = ({ upload, clip_sha256 }: Place) =>
  upload === null ? `/clips/${clip_sha256}.mp4` : `/api/admin/uploads/${upload}/clips/${clip_sha256}`;

function Thumbnail({ clip }: { clip: Place }) {
  const { ref, inViewport } = useInViewport<HTMLCanvasElement>();
  const canvas = useRef<HTMLCanvasElement | null>(null);
  const address = addressOf(clip);
  useEffect(() => {
    if (!inViewport) return;
    void firstFrame(address).then((frame) => {
      const context = canvas.current?.getContext("2d");
      if (frame === null || !context) return;
      context.canvas.height = Math.round((context.canvas.width * frame.height) / frame.width);
      context.drawImage(frame, 0, 0, context.canvas.width, context.canvas.height);
      context.canvas.dataset["drawn"] = "true";
    });
  }, [address, inViewport]);
  return (
    <canvas
      ref={(element) => {
        canvas.current = element;
        ref(element);
      }}
      width={THUMB_PX}
      height={60}
      aria-hidden
    />
  );
}

// Places of the grid: pressed, dragged, dropped on.

interface Hand {
  /** The clip that was chosen, to be put into a place. */
  held: Place | null;
  hold: (clip: Place | null) => void;
  put: (clip: Place, to: Slot | null) => void;
}

interface SpotProps extends Hand {
  /** The place; null for a clip that is in no cell. */
  slot: Slot | null;
  clip: Place | null;
}

function Spot({ slot, clip, held, hold, put }: SpotProps) {
  const { over, handlers } = useDropTarget(
    () => held !== null && slot !== null,
    () => held !== null && slot !== null && put(held, slot),
  );
  const press = () => {
    if (held === null) hold(clip);
    else if (clip === held) hold(null);
    else if (slot === null) hold(clip);
    else put(held, slot);
  };
  const keys = (event: KeyboardEvent) => {
    if (event.key === "Escape") hold(null);
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    press();
  };
  const what = clip === null ? "empty" : clip.file;
  const isHeld = clip !== null && held === clip;
  // Not a <button>: Firefox drags none.
  return (
    <div
      role="button"
      tabIndex={0}
      className={`spot${over ? " over" : ""}${clip === null ? " empty" : ""}`}
      aria-pressed={isHeld}
      aria-label={`${slot?.name ?? "In no cell"}: ${what}`}
      title={what}
      onClick={press}
      onKeyDown={keys}
      draggable={clip !== null}
      onDragStart={(event) => {
        event.dataTransfer.setData("text/plain", what);
        event.dataTransfer.effectAllowed = "move";
        hold(clip);
      }}
      onDragEnd={() => hold(null)}
      {...handlers}
    >
      {clip !== null && <Thumbnail clip={clip} />}
      <span className="spot-name">{what}</span>
    </div>
  );
}

// The grid: a row for each combination of the first factors, a column for each level of the last.

function Grid({ data, filled, ...hand }: Hand & { data: Data; filled: { slot: Slot; clip: Place | null }[] }) {
  const factors = factorsOf(data);
  const last = factors.at(-1);
  const label = (factor: number, level: string) => {
    const declared = listAt(listAt(data, ["factors"])[factor], ["levels"]).find((one) => textAt(one, ["name"]) === level);
    return textAt(declared, ["label"]) || textAt(declared, ["label", "en"]) || level;
  };
  const rows = useMemo(() => {
    const matches = new Map<string, { slot: Slot; clip: Place | null }[]>();
    const lead = factors.slice(0, -1);
    for (const one of filled) {
      const key = lead.map(({ name }, index) => label(index, one.slot.levels[name] ?? "")).join(", ");
      matches.set(key, [...(matches.get(key) ?? []), one]);
    }
    return [...matches];
    // eslint-disable-next-line react-hooks/exhaustive-deps -- `factors` and `label` follow from `data`
  }, [data, filled]);
  if (last === undefined) return null;
  return (
    <div className="grid-of-cells" tabIndex={0} role="region" aria-label="Cells and their clips">
      <table aria-label="Cells">
        <thead>
          <tr>
            <th scope="col">{factors.map(({ name }) => name).join(", ")}</th>
            {last.levels.map((level) => (
              <th key={level} scope="col">
                {label(factors.length - 1, level)}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.map(([key, places]) => (
            <tr key={key}>
              <th scope="row">{key === "" ? "clips" : key}</th>
              {last.levels.map((level) => (
                <td key={level}>
                  {places
                    .filter(({ slot }) => slot.levels[last.name] === level)
                    .map(({ slot, clip }) => (
                      <Spot key={slot.name} slot={slot} clip={clip} {...hand} />
                    ))}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/** The clip in hand, and where it may go: the whole list of places, for keyboards. */
function Held({ filled, held, put, hold }: Hand & { filled: { slot: Slot; clip: Place | null }[] }) {
  if (held === null) return null;
  const isPlaced = filled.some(({ clip }) => clip === held);
  return (
    <Group gap="xs" align="end" role="group" aria-label="Move a clip">
      <Select
        label={`Move ${held.file} to`}
        description="If the cell has a clip already, the two swap places."
        placeholder="Choose a cell"
        searchable
        data={filled.map(({ slot, clip }) => ({ value: slot.name, label: clip === null ? `${slot.name} (empty)` : slot.name }))}
        value={null}
        onChange={(name) => {
          const to = filled.find(({ slot }) => slot.name === name);
          if (to !== undefined) put(held, to.slot);
        }}
        w={340}
      />
      {isPlaced && (
        <Button size="xs" variant="default" onClick={() => put(held, null)}>
          Take out of its cell
        </Button>
      )}
      <Button size="xs" variant="default" onClick={() => hold(null)}>
        Cancel
      </Button>
    </Group>
  );
}

/** Cells from the names of files: a shortcut. */
function ByNames({ clips, fill }: { clips: readonly Place[]; fill: (pattern: string) => void }) {
  const builder = useBuilderHere();
  const files = clips.map(({ file }) => file);
  const suggested = () =>
    declaredPattern(
      factorsOf(builder.data).map(({ name, levels }) => ({ name, levels: levels.map((level) => ({ name: level })) })),
      files,
    );
  const [typed, setPattern] = useState<string | null>(null);
  const pattern = typed ?? suggested();
  const fields = fieldsOf(pattern).filter((field) => field !== "exemplar");
  const fits = fields.length === 0 ? 0 : levelsByPattern(pattern, files).filter(({ levels }) => levels !== null).length;
  return (
    <details>
      <summary className="small-summary">Fill by file names</summary>
      <Group align="end" mt="xs">
        <TextInput
          label="Pattern"
          description="Names of factors in braces; {exemplar} numbers the clips of a cell. Factors and levels that are new are added."
          placeholder="{character}_{speed}_{exemplar}.mp4"
          value={pattern}
          onChange={(event) => setPattern(event.currentTarget.value)}
          w={420}
        />
        <Button variant="default" disabled={fits === 0} onClick={() => fill(pattern)}>
          Fill the grid
        </Button>
        <Text size="sm" role="status">
          {`${String(fits)} of ${String(files.length)} file names fit.`}
        </Text>
      </Group>
    </details>
  );
}

interface ClipsProps {
  data: Data;
  places: readonly Place[];
  arrange: (places: readonly Place[]) => void;
  /** What becomes of clips that are in no cell. */
  otherwise: string;
}

/** The grid with its clips, those in no cell, and the clip in hand. */
function ClipsInCells({ data, places, arrange, otherwise }: ClipsProps) {
  const { filled, rest } = useMemo(() => arrangementOf(places, data), [places, data]);
  const [chosen, setChosen] = useState<Place | null>(null);
  // After an undo or another edit the same clip is another object.
  const held = chosen === null ? null : (places.find((member) => isClip(member, chosen)) ?? null);
  const empty = filled.filter(({ clip }) => clip === null).map(({ slot }) => slot.name);
  const hand: Hand = {
    held,
    hold: setChosen,
    put: (clip, to) => {
      arrange(withMoved(places, data, clip, to));
      setChosen(null);
    },
  };
  return (
    <>
      <Text size="sm">
        Drag a clip into a cell. Or choose a clip (click, Enter or Space), then choose its place in the same way. Escape puts it back.
      </Text>
      <Grid data={data} filled={filled} {...hand} />
      <Held filled={filled} {...hand} />
      {empty.length > 0 && (
        <Alert color="yellow" variant="light" title={`${counted(empty.length, "place is", "places are")} empty`} role="status">
          {empty.slice(0, MAX_NAMED).join("; ")}
          {empty.length > MAX_NAMED && ` and ${String(empty.length - MAX_NAMED)} more`}
        </Alert>
      )}
      {rest.length > 0 && (
        <div role="group" aria-label="Clips in no cell">
          <Text size="sm">
            {counted(rest.length, "clip is", "clips are")} in no cell{otherwise}
          </Text>
          <div className="spots">
            {rest.map((clip) => (
              <Spot key={`${clip.clip_sha256}${clip.file}`} slot={null} clip={clip} {...hand} />
            ))}
          </div>
        </div>
      )}
    </>
  );
}

export function LevelGrid({ study }: { study: string }) {
  const builder = useBuilderHere();
  const { data, arrange } = builder;
  const sent = useUpload(`study ${study}`);
  const uploaded = sent.received;
  const places = useMemo(() => withUploaded(builder.places ?? [], uploaded), [builder.places, uploaded]);
  const unplayed = playNeeded(sent);
  const fill = (pattern: string) => {
    const next = filledByPattern(places, data, pattern);
    arrange(next.places, next.data);
  };
  return (
    <Stack gap="xs">
      <ClipsInCells data={data} places={places} arrange={arrange} otherwise=" and will not be part of the next version:" />
      <ByNames clips={places} fill={fill} />
      <details>
        <summary className="small-summary">Add clips</summary>
        <Stack gap="xs" mt="xs">
          <UploadClips upload={sent} />
          {unplayed !== false && <Text size="sm">{`Still needed: ${unplayed}.`}</Text>}
        </Stack>
      </details>
    </Stack>
  );
}

interface NewGridProps {
  cells: NewCells;
  onChange: (cells: NewCells) => void;
}

/** The grid of a study that is being made: what varies is typed, and its clips are put into the cells. */
export function NewGrid({ cells, onChange }: NewGridProps) {
  const { factors, places } = cells;
  const data = useMemo(() => designOfTyped(cells), [cells]);
  const change = (index: number, part: Partial<TypedFactor>) =>
    onChange({ ...cells, factors: factors.map((factor, number) => (number === index ? { ...factor, ...part } : factor)) });
  const isDrawn = listAt(data, ["factors"]).length > 0;
  return (
    <Stack gap="xs">
      {factors.map(({ name, levels }, index) => (
        <Group key={index} align="end" role="group" aria-label={`Factor ${index + 1}`}>
          <TextInput
            label={index === 0 ? "What varies" : "What else varies"}
            placeholder="speed"
            value={name}
            onChange={(event) => change(index, { name: event.currentTarget.value })}
            w={220}
          />
          <TextInput
            label="Its levels, separated by commas"
            placeholder="slow, normal, fast"
            value={levels}
            onChange={(event) => change(index, { levels: event.currentTarget.value })}
            w={380}
          />
          {factors.length > 1 && (
            <Button
              variant="default"
              aria-label={`Remove factor ${index + 1}`}
              onClick={() => onChange({ ...cells, factors: factors.filter((_, number) => number !== index) })}
            >
              Remove
            </Button>
          )}
        </Group>
      ))}
      <Group gap="xs">
        <Button size="xs" variant="default" onClick={() => onChange({ ...cells, factors: [...factors, { name: "", levels: "" }] })}>
          Add something else that varies
        </Button>
        <Button size="xs" variant="default" disabled={!isDrawn} onClick={() => onChange({ ...cells, places: filledInOrder(cells) })}>
          Fill the grid in order of the file names
        </Button>
      </Group>
      {isDrawn && <ClipsInCells data={data} places={places} arrange={(next) => onChange({ ...cells, places: next })} otherwise=":" />}
    </Stack>
  );
}

const MAX_NAMED = 8;

/** The study's clips and those of an upload that can be used, in no cell until somebody puts them into one. */
function withUploaded(places: readonly Place[], upload: ReturnType<typeof useUpload>["received"]): Place[] {
  const ready = upload === null ? [] : uploadedPlaces(upload);
  return reconciled(places, [...places.filter((member) => member.upload === null), ...ready]);
}
