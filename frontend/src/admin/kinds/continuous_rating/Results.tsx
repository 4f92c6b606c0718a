/** Continuous ratings: the mean trace of each cell, and when its clips blink. */

import { Card, SimpleGrid, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../../api";
import { type Column, DataTable } from "../../ui/DataTable";
import { fixed } from "../../ui/format";
import { PlotFigure } from "../../ui/PlotFigure";
import { HowShown } from "../../results/HowShown";
import { type Factors, type ShownResults, useCellLabels } from "../../results/plots";
import { cellTracePlot, traceRows, tracesPlot } from "./plots";

type Data = Schemas["TraceResults"];
type Cell = Schemas["TraceCell"];

export function KindResults({ data, factors }: ShownResults) {
  return data.kind === "continuous_rating" ? <TraceResults data={data} factors={factors} /> : null;
}

function TraceResults({ data, factors }: { data: Data; factors: Factors }) {
  const labels = useCellLabels(data.cells, factors);
  const together = useMemo(() => tracesPlot(data, labels), [data, labels]);
  return (
    <>
      <Card withBorder>
        <Title order={2} size="h5">
          Mean ratings over the clip
        </Title>
        <Text size="sm">
          Clips are averaged within people, then over people. Responses lag about one second behind the clip; the report states the lag.
        </Text>
        <PlotFigure options={together} label="Mean rating over time in every cell" rows={traceRows(data.cells, labels)} />
      </Card>
      <SimpleGrid cols={{ base: 1, md: 2 }}>
        {data.cells.map((cell) => (
          <CellCard key={cell.cell} cell={cell} data={data} label={labels.get(cell.cell) ?? cell.cell} />
        ))}
        <HowShown data={data} />
      </SimpleGrid>
      <Card withBorder>
        <Title order={2} size="h5" mb="xs">
          Cells
        </Title>
        <DataTable label="Cells" rows={data.cells} rowKey={({ cell }) => cell} columns={levelColumns(labels)} empty="No traces." />
      </Card>
    </>
  );
}

function CellCard({ cell, data, label }: { cell: Cell; data: Data; label: string }) {
  const options = useMemo(() => cellTracePlot(cell, data), [cell, data]);
  const blinks = cell.blinks_s.length > 0 ? "Ticks: blinks in the clips, one row per clip." : "No blinks are marked in its clips.";
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        {label}
      </Title>
      <Text size="sm">
        {blinks}
        {cell.left_out > 0 && ` ${cell.left_out} traces with another sampling rate are excluded.`}
      </Text>
      <PlotFigure
        options={options}
        label={`Mean rating over time with its interval, ${label}`}
        rows={traceRows([cell], new Map([[cell.cell, label]]))}
      />
    </Card>
  );
}

function levelColumns(labels: Map<string, string>): Column<Cell>[] {
  return [
    { title: "Cell", cell: ({ cell }) => labels.get(cell) },
    { title: "People", number: true, cell: ({ people }) => people.toLocaleString() },
    { title: "Traces", number: true, cell: ({ traces }) => traces.toLocaleString() },
    { title: "Mean", number: true, cell: ({ level }) => fixed(level) },
  ];
}
