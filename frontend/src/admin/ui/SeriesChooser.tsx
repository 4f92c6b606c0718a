import { Select } from "@mantine/core";
import type { Schemas } from "../api";

interface Props {
  every: Schemas["SeriesOut"][] | undefined;
  chosen: number | null;
  choose: (series: number | null) => void;
  /** The text shown while none is chosen. */
  without: string;
}

/** The data series of a study that has several. */
export function SeriesChooser({ every, chosen, choose, without }: Props) {
  if (every === undefined || every.length < 2) return null;
  return (
    <Select
      aria-label="Data series"
      w={280}
      clearable
      placeholder={without}
      value={chosen === null ? null : String(chosen)}
      onChange={(word) => choose(word === null ? null : Number(word))}
      data={every.map(({ number, name }) => ({ value: String(number), label: name }))}
    />
  );
}
