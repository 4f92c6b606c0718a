/** Response times and playback, whatever the kind of trial. */
import { Card, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import { words, methodWords, ruleWords } from "../ui/format";
import { PlotFigure } from "../ui/PlotFigure";
import { delayRows, timeRows, type AnyResults, delayPlot, timePlot } from "./plots";

export function HowShown({ data }: { data: AnyResults }) {
  const times = useMemo(() => timePlot(data), [data]);
  const delays = useMemo(() => delayPlot(data), [data]);
  return (
    <>
      <Card withBorder>
        <Title order={2} size="h5">
          Response times from the clip's end
        </Title>
        <PlotFigure options={times} label="Histogram of response times" rows={timeRows(data)} />
      </Card>
      <Card withBorder>
        <Title order={2} size="h5">
          How clips were shown
        </Title>
        <Text size="sm" c="dimmed">
          Every presentation of main trials.
        </Text>
        <Counts title="Verdicts" counts={data.playback.verdicts} said={words} />
        <Counts title="Reasons" counts={data.playback.rules} said={ruleWords} />
        <Counts title="Shown" counts={data.playback.methods} said={methodWords} />
        <PlotFigure options={delays} label="Histogram of the time from key to first frame" rows={delayRows(data)} />
      </Card>
    </>
  );
}

interface CountsProps {
  title: string;
  counts: Record<string, number>;
  said: (word: string) => string;
}

function Counts({ title, counts, said }: CountsProps) {
  const entries = Object.entries(counts);
  if (entries.length === 0) return null;
  return (
    <Text size="sm">
      {title} – {entries.map(([word, count]) => `${said(word)}: ${count.toLocaleString()}`).join("; ")}
    </Text>
  );
}
