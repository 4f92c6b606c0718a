/** The results as the study's kind of trial shows them, charts and all: loaded once there are answers. */
import { Alert, SimpleGrid, Stack, Text } from "@mantine/core";
import type { ComponentType } from "react";
import type { Schemas } from "../api";
import { type Column, DataTable } from "../ui/DataTable";
import { counted, fixed, when, labelOfOrigin } from "../ui/format";
import { HowShown } from "./HowShown";
import type { ShownResults } from "./plots";

/** By the name of the kind: what a file of its folder in ../kinds shows. */
const pages = import.meta.glob<ComponentType<ShownResults>>("../kinds/*/Results.tsx", { import: "KindResults", eager: true });

type AnsweredCell = Schemas["AnsweredCell"];

const CELL: Column<AnsweredCell> = { title: "Cell", cell: ({ cell }) => cell };
const SECOND: Column<AnsweredCell> = { title: "Second clip", cell: ({ second }) => second };
const NUMBERS: Column<AnsweredCell>[] = [
  { title: "Answers", number: true, cell: ({ n }) => n.toLocaleString() },
  { title: "Mean", number: true, cell: ({ mean }) => fixed(mean) },
];

export function OfKind({ study, data, factors }: ShownResults) {
  const KindResults = pages[`../kinds/${data.kind}/Results.tsx`];
  return (
    <Stack>
      <Alert>
        Data series {data.series}, {labelOfOrigin(data.origin).toLowerCase()}: {counted(data.participants, "run")} with answers,{" "}
        {counted(data.ratings, "answer")}, counted {when(data.counted_at)}.{" "}
        {data.origin === "simulated" && "Simulated participants: no person gave these answers. "}The charts update as answers arrive. For
        the analysis, see the report below.
      </Alert>
      {KindResults !== undefined && <KindResults study={study} data={data} factors={factors} />}
      {data.kind === "other" && (
        <>
          <Text>{data.note}</Text>
          <DataTable
            label="Answers by cell"
            rows={data.cells}
            rowKey={({ cell, second }) => `${cell} ${second ?? ""}`}
            columns={data.cells.some(({ second }) => second !== null) ? [CELL, SECOND, ...NUMBERS] : [CELL, ...NUMBERS]}
            empty="No answers."
          />
          <SimpleGrid cols={{ base: 1, md: 2 }}>
            <HowShown data={data} />
          </SimpleGrid>
        </>
      )}
    </Stack>
  );
}
