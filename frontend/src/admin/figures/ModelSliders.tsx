import { Alert, Button, Card, Group, SimpleGrid, Slider, Stack, Text } from "@mantine/core";
import { useMemo, useState } from "react";
import type { Schemas } from "../api";
import { ClosureFigure } from "../ui/PlotFigure";
import { downloadText } from "../ui/useChange";
import { Character } from "./Character";
import { curveCsv } from "./Recorded";

// The PCA blink model as `stimuli model fit` writes it, and the blink of given coefficients.

export interface BlinkModel {
  fps: number;
  down_frames: number;
  up_frames: number;
  scale_weight: number;
  explained: number[];
  coefficient_sd: number[];
  mean: number[];
  components: number[][];
}

/** Read the model's JSON; an Error where a part is missing. */
function readModel(json: Record<string, unknown>): BlinkModel {
  const numbers = (name: string): number[] => {
    const value = json[name];
    if (!Array.isArray(value) || !value.every((one) => typeof one === "number")) throw new Error(`the model has no ${name}`);
    return value;
  };
  const number = (name: string): number => {
    const value = json[name];
    if (typeof value !== "number") throw new Error(`the model has no ${name}`);
    return value;
  };
  const rows = json["components"];
  if (!Array.isArray(rows)) throw new Error("the model has no components");
  return {
    fps: number("fps"),
    down_frames: number("down_frames"),
    up_frames: number("up_frames"),
    scale_weight: number("scale_weight"),
    explained: numbers("explained"),
    coefficient_sd: numbers("coefficient_sd"),
    mean: numbers("mean"),
    components: rows.map((row: unknown) => (Array.isArray(row) ? row.map(Number) : [])),
  };
}

/** Closure per frame for coefficients in standard deviations; `valid` is false where the lids would overlap. */
function blinkOf(model: BlinkModel, deviations: readonly number[]): { closure: number[]; valid: boolean } {
  const row = model.mean.map((mean, frame) =>
    model.components.reduce(
      (sum, component, mode) => sum + (deviations[mode] ?? 0) * (model.coefficient_sd[mode] ?? 0) * (component[frame] ?? 0),
      mean,
    ),
  );
  const form = row.slice(0, model.down_frames + model.up_frames + 1);
  const [downScale = 0, upScale = 0] = row.slice(-2).map((value) => value / model.scale_weight);
  const down = Math.max(1, Math.round(model.down_frames * downScale));
  const up = Math.max(1, Math.round(model.up_frames * upScale));
  const closing = resampled(form.slice(0, model.down_frames + 1), down + 1);
  const opening = resampled(form.slice(model.down_frames), up + 1);
  const closure = [...closing, ...opening.slice(1)].map((value) => Math.max(0, value));
  return { closure: closure.map((value) => Math.min(1, value)), valid: Math.max(...form) <= 1 };
}

/** `values` at `length` equally spaced places, by straight lines between samples. */
function resampled(values: readonly number[], length: number): number[] {
  return Array.from({ length }, (_, index) => {
    const at = (index * (values.length - 1)) / Math.max(1, length - 1);
    const before = Math.floor(at);
    const left = values[before] ?? 0;
    return left + (at - before) * ((values[before + 1] ?? left) - left);
  });
}

export function ModelSliders({ library }: { library: Schemas["BlinkLibrary"] }) {
  const model = useMemo(() => readModel(library.model), [library]);
  const [deviations, setDeviations] = useState<number[]>(() => model.coefficient_sd.map(() => 0));
  const { closure, valid } = useMemo(() => blinkOf(model, deviations), [model, deviations]);
  return (
    <SimpleGrid cols={{ base: 1, md: 2 }}>
      <Card withBorder>
        <Stack gap="lg">
          {model.explained.map((share, mode) => (
            <div key={`mode${String(mode)}`}>
              <Text size="sm" className="number">
                Component {mode + 1}: {(100 * share).toFixed(1)}% of the variance, now at {(deviations[mode] ?? 0).toFixed(1)} sd
              </Text>
              <Slider
                min={-2}
                max={2}
                step={0.1}
                value={deviations[mode] ?? 0}
                label={(value) => `${value.toFixed(1)} sd`}
                thumbLabel={`Component ${mode + 1} in standard deviations`}
                marks={[{ value: -1 }, { value: 0 }, { value: 1 }]}
                onChange={(value) => setDeviations(deviations.map((before, index) => (index === mode ? value : before)))}
              />
            </div>
          ))}
          <Group>
            <Button variant="default" onClick={() => setDeviations(model.coefficient_sd.map(() => 0))}>
              Mean blink
            </Button>
            <Button variant="default" onClick={() => setDeviations(model.coefficient_sd.map(() => 2 * Math.random() - 1))}>
              Random blink
            </Button>
            <Button variant="default" onClick={() => downloadText("model-blink.csv", curveCsv(closure))}>
              Download this curve
            </Button>
          </Group>
          <Text size="sm" c="dimmed">
            The model samples coefficients within one standard deviation (the marks on the sliders).
          </Text>
        </Stack>
      </Card>
      <Card withBorder className="first-when-narrow">
        <Character closure={closure} fps={model.fps} />
        <ClosureFigure closure={closure} height={220} label="Closure of this blink over time" />
        <Text size="sm">
          {((closure.length * 1000) / model.fps).toFixed(0)} ms, greatest closure {Math.max(...closure).toFixed(2)}
        </Text>
        {!valid && (
          <Alert color="yellow" mt="sm">
            The lids would overlap; the model rejects such blinks.
          </Alert>
        )}
      </Card>
    </SimpleGrid>
  );
}
