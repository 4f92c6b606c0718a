/** Nothing to show of one origin: whose runs there are instead, one press away. */

import { Button, Group, Text } from "@mantine/core";
import { counted } from "../ui/format";
import { type DataOrigin, ORIGINS } from "./origins";

interface Props {
  origin: DataOrigin;
  runs: Record<string, number>;
  choose: (origin: DataOrigin) => void;
}

const OF: Record<DataOrigin, string> = { participant: "participants", pilot: "the pilot", simulated: "simulated people" };

export function NoAnswers({ origin, runs, choose }: Props) {
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
