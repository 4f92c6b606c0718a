/** How questions and scales of a trial look, while they are edited. Clips are not played here: a preview link does that. */

import { Group, Paper, SegmentedControl, Slider, Stack, Text } from "@mantine/core";
import { useState } from "react";
import { languageName } from "../ui/format";
import { type Data, isTable, textAt } from "./data";
import { shownClips } from "../kinds";
import { useBuilderHere } from "./useBuilder";

const DEFAULT_POINTS: [number, number] = [1, 7];
const DEFAULT_SLIDER: [number, number] = [0, 100];

export function TrialPreview() {
  const builder = useBuilderHere();
  const [chosen, setChosen] = useState<string | null>(null);
  const language = chosen !== null && builder.languages.includes(chosen) ? chosen : (builder.languages[0] ?? "en");
  const clips = shownClips(builder.data["trial"]);
  const asked = scalesIn(builder.data["trial"]);
  return (
    <Paper withBorder p="md" role="group" aria-label="Preview of the trial">
      <Group justify="space-between" mb="sm">
        <Text size="sm" fw={600}>
          As participants see it
        </Text>
        {builder.languages.length > 1 && (
          <SegmentedControl
            size="xs"
            aria-label="Language of the preview"
            value={language}
            onChange={setChosen}
            data={builder.languages.map((code) => ({ value: code, label: languageName(code) }))}
          />
        )}
      </Group>
      <div className={`preview-clips ${clips.stacked ? "stacked" : ""}`}>
        {clips.words.map((word) => (
          <div key={word} className="preview-clip">
            {word}
          </div>
        ))}
      </div>
      <Stack gap="lg" mt="md" align="center">
        {asked.map((scale, index) => (
          <OneScale key={index} scale={scale} language={language} />
        ))}
      </Stack>
    </Paper>
  );
}

/** Every table with a question, anywhere in the trial. */
function scalesIn(value: unknown): Data[] {
  if (Array.isArray(value)) return (value as unknown[]).flatMap(scalesIn);
  if (!isTable(value)) return [];
  if (isTable(value["question"])) return [value];
  return Object.values(value).flatMap(scalesIn);
}

function OneScale({ scale, language }: { scale: Data; language: string }) {
  const isSlider = scale["type"] === "slider";
  const [low, high] = isSlider ? DEFAULT_SLIDER : DEFAULT_POINTS;
  const minimum = typeof scale["minimum"] === "number" ? scale["minimum"] : low;
  const maximum = typeof scale["maximum"] === "number" ? scale["maximum"] : high;
  const hasEnds = isTable(scale["low"]) || isTable(scale["high"]);
  const labels = Array.isArray(scale["labels"]) ? (scale["labels"] as unknown[]) : [];
  const points = Math.min(11, Math.max(0, maximum - minimum + 1));
  return (
    <Stack gap={6} miw={260} maw={480} w={isSlider || labels.length > 0 ? "100%" : "auto"}>
      <Text ta="center">{textAt(scale["question"], [language]) || "–"}</Text>
      {hasEnds && isSlider && <SliderPreview minimum={minimum} maximum={maximum} />}
      {labels.length > 0 && (
        <Group gap={4} align="stretch" wrap="nowrap" grow>
          {labels.slice(0, points).map((label, index) => (
            <span key={index} className="preview-key wrap-anywhere">
              {minimum + index}{" "}
              <Text span display="block" size="xs">
                {textAt(label, [language])}
              </Text>
            </span>
          ))}
        </Group>
      )}
      {hasEnds && !isSlider && (
        <Group gap={4} justify="center" wrap="nowrap">
          {Array.from({ length: points }, (_, index) => (
            <span key={index} className="preview-key">
              {minimum + index}
            </span>
          ))}
        </Group>
      )}
      {hasEnds && (
        <Group justify="space-between" wrap="nowrap">
          <Text size="xs">{textAt(scale["low"], [language])}</Text>
          <Text size="xs" ta="end">
            {textAt(scale["high"], [language])}
          </Text>
        </Group>
      )}
    </Stack>
  );
}

/** As participants meet it: a line without a handle, and so without an answer, until it is touched. */
function SliderPreview({ minimum, maximum }: { minimum: number; maximum: number }) {
  const [value, setValue] = useState<number | null>(null);
  return (
    <Slider
      className={value === null ? "untouched" : ""}
      min={minimum}
      max={maximum}
      value={value ?? (minimum + maximum) / 2}
      onChange={setValue}
      label={null}
      thumbLabel="slider"
    />
  );
}
