/** Response times and playback, whatever the kind of trial. */

import { Card, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import { words } from "../ui/format";
import { PlotFigure } from "../ui/PlotFigure";
import { type AnyResults, delayPlot, timePlot } from "./plots";

export function HowShown({ data }: { data: AnyResults }) {
  const times = useMemo(() => timePlot(data), [data]);
  const delays = useMemo(() => delayPlot(data), [data]);
  return (
    <>
      <Card withBorder>
        <Title order={2} size="h5">
          Response times from the clip's end
        </Title>
        <PlotFigure options={times} label="Histogram of response times" />
      </Card>
      <Card withBorder>
        <Title order={2} size="h5">
          How clips were shown
        </Title>
        <Counts title="Verdicts" counts={data.playback.verdicts} />
        <Counts title="Reasons" counts={data.playback.rules} />
        <Counts title="Played by" counts={data.playback.methods} />
        <PlotFigure options={delays} label="Histogram of the time from key to first frame" />
      </Card>
    </>
  );
}

function Counts({ title, counts }: { title: string; counts: Record<string, number> }) {
  const entries = Object.entries(counts);
  if (entries.length === 0) return null;
  return (
    <Text size="sm">
      {title}: {entries.map(([word, count]) => `${words(word)} ${count.toLocaleString()}`).join(", ")}
    </Text>
  );
}
