/** Continuous ratings: the mean trace of each cell, and when its clips blink. */

import { Card, SimpleGrid, Table, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../api";
import { fixed } from "../ui/format";
import { PlotFigure } from "../ui/PlotFigure";
import { HowShown } from "./HowShown";
import { cellLabels, type Factors } from "./plots";
import { cellTracePlot, tracesPlot } from "./trace-plots";

type Data = Schemas["TraceResults"];
type Cell = Schemas["TraceCell"];

export function TraceResults({ data, factors }: { data: Data; factors: Factors }) {
  const labels = useMemo(
    () =>
      cellLabels(
        data.cells.map(({ cell }) => cell),
        factors,
      ),
    [data, factors],
  );
  const together = useMemo(() => tracesPlot(data, labels), [data, labels]);
  return (
    <>
      <Card withBorder>
        <Title order={2} size="h5">
          Mean ratings over the clip
        </Title>
        <Text size="sm">
          Each person&apos;s clips of a cell are averaged first, then people. People answer what they see about a second later; how much
          later is in the report.
        </Text>
        <PlotFigure options={together} label="Mean rating over time in every cell" />
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
        <Levels data={data} labels={labels} />
      </Card>
    </>
  );
}

function CellCard({ cell, data, label }: { cell: Cell; data: Data; label: string }) {
  const options = useMemo(() => cellTracePlot(cell, data), [cell, data]);
  const blinks = cell.blinks_s.length > 0 ? " Ticks below: when its clips blink, a row a clip." : " Its clips have no marked blinks.";
  const interval = cell.low === null ? "One person, so no interval." : "Shaded: 95% interval over people.";
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        {label}
      </Title>
      <Text size="sm">
        {interval}
        {blinks}
        {cell.left_out > 0 && ` ${cell.left_out} traces of another sampling rate are left out.`}
      </Text>
      <PlotFigure options={options} label={`Mean rating over time with its interval, ${label}`} />
    </Card>
  );
}

function Levels({ data, labels }: { data: Data; labels: Map<string, string> }) {
  return (
    <Table.ScrollContainer minWidth={320}>
      <Table>
        <Table.Thead>
          <Table.Tr>
            {["Cell", "People", "Traces", "Mean"].map((head) => (
              <Table.Th key={head}>{head}</Table.Th>
            ))}
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {data.cells.map(({ cell, people, traces, level }) => (
            <Table.Tr key={cell}>
              <Table.Td>{labels.get(cell)}</Table.Td>
              {[people, traces].map((count, place) => (
                <Table.Td key={place} className="number">
                  {count.toLocaleString()}
                </Table.Td>
              ))}
              <Table.Td className="number">{fixed(level)}</Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}
