/** Nothing to show of one origin: whose runs there are instead, one press away. */

import { Button, Group, Stack, Text } from "@mantine/core";
import type { Schemas } from "../api";
import { counted } from "../ui/format";
import { Elsewhere, elsewhere } from "./Elsewhere";
import { type DataOrigin, ORIGINS } from "./origins";

interface Props {
  origin: DataOrigin;
  runs: Record<string, number>;
  every: Schemas["SeriesOut"][];
  series: number;
  choose: (origin: DataOrigin) => void;
  chooseSeries: (series: number) => void;
}

const OF: Record<DataOrigin, string> = { participant: "participants", pilot: "the pilot", simulated: "simulated people" };

export function NoAnswers({ origin, runs, every, series, choose, chooseSeries }: Props) {
  if (elsewhere({ every, shown: series, origin }).length > 0)
    return (
      <Stack gap="xs">
        <Text c="dimmed">Data series {series} is new and has no answers yet.</Text>
        <Elsewhere every={every} shown={series} origin={origin} choose={chooseSeries} />
      </Stack>
    );
  const others = ORIGINS.filter(({ value }) => value !== origin && (runs[value] ?? 0) > 0);
  const listed = others.map(({ value }) => `${counted(runs[value] ?? 0, "run")} of ${OF[value]}`).join(" and ");
  return (
    <Group>
      <Text c="dimmed">
        No answers of {OF[origin]} in this data series yet
        {others.length > 0 && `; the only answers are those of ${listed}`}.
      </Text>
      {others.map(({ value, label }) => (
        <Button key={value} variant="default" size="xs" onClick={() => choose(value)}>
          Show {label.toLowerCase()}
        </Button>
      ))}
    </Group>
  );
}
