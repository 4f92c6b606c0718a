import { Alert, Button, Card, Group, SimpleGrid, Slider, Stack, Text } from "@mantine/core";
import { useMemo, useState } from "react";
import type { Schemas } from "../api";
import { ClosureFigure } from "../ui/ClosureFigure";
import { downloadText } from "../ui/download";
import { Character } from "./Character";
import { blinkOf, readModel } from "./model";
import { curveCsv } from "./Recorded";

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
              A random blink
            </Button>
            <Button variant="default" onClick={() => downloadText("model-blink.csv", curveCsv(closure))}>
              Download this curve
            </Button>
          </Group>
          <Text size="sm" c="dimmed">
            The model draws coefficients within one standard deviation, the marks on the sliders.
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
            The lids would overlap: the model drops such a blink.
          </Alert>
        )}
      </Card>
    </SimpleGrid>
  );
}
