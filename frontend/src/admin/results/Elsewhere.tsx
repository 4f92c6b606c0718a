/** Where the visits of an origin are that a data series has none of: said, and one press away. */

import { Button, Group, Text } from "@mantine/core";
import type { Schemas } from "../api";
import { counted } from "../ui/format";
import type { DataOrigin } from "./origins";

interface Props {
  every: Schemas["SeriesOut"][];
  /** The data series that is shown. */
  shown: number;
  origin: DataOrigin;
  choose: (series: number) => void;
}

const PEOPLE: Record<DataOrigin, [one: string, several: string]> = {
  participant: ["participant is", "participants are"],
  pilot: ["pilot visit is", "pilot visits are"],
  simulated: ["simulated visit is", "simulated visits are"],
};

export function elsewhere({ every, shown, origin }: Omit<Props, "choose">): Schemas["SeriesOut"][] {
  const present = every.find(({ number }) => number === shown);
  if ((present?.runs[origin] ?? 0) > 0) return [];
  return every.filter(({ number, runs }) => number !== shown && (runs[origin] ?? 0) > 0);
}

export function Elsewhere({ choose, ...of }: Props) {
  return elsewhere(of).map(({ number, name, runs }) => (
    <Group key={number} gap="xs">
      <Text>{`${counted(runs[of.origin] ?? 0, ...PEOPLE[of.origin])} in ${name}.`}</Text>
      <Button variant="default" size="xs" onClick={() => choose(number)}>
        Show them
      </Button>
    </Group>
  ));
}
