/** Paired comparisons: what was chosen between cells, and how often each level was. */

import { Card, SimpleGrid, Table, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../api";
import { PlotFigure } from "../ui/PlotFigure";
import { HowShown } from "./HowShown";
import { choicePlot, comparedCells, levelPlot } from "./pair-plots";
import { type Factors, labelsOf } from "./plots";

type Data = Schemas["PairResults"];

export function PairResults({ data, factors }: { data: Data; factors: Factors }) {
  const labels = useMemo(() => comparedCells(data, factors), [data, factors]);
  const choices = useMemo(() => choicePlot(data, labels), [data, labels]);
  const sides = data.left + data.right + data.ties;
  const share = (count: number) => (sides === 0 ? "–" : `${Math.round((100 * count) / sides)}%`);
  return (
    <>
      <SimpleGrid cols={{ base: 1, md: 2 }}>
        <Card withBorder>
          <Title order={2} size="h5">
            Chosen over
          </Title>
          <Text size="sm">
            Share of comparisons in which the cell of the row was chosen over that of the column, which has the number of its row; a tie is
            half for each.
          </Text>
          <PlotFigure options={choices} label="Share of choices in each pair of cells" />
        </Card>
        {factors.map(({ name }) => (
          <LevelCard key={name} name={name} data={data} factors={factors} />
        ))}
        <HowShown data={data} />
      </SimpleGrid>
      <Card withBorder>
        <Title order={2} size="h5" mb="xs">
          Each pair of cells
        </Title>
        <Text size="sm">
          Left (or first) {share(data.left)}, right (or second) {share(data.right)}, neither {share(data.ties)}.
        </Text>
        <Table.ScrollContainer minWidth={480}>
          <Table>
            <Table.Thead>
              <Table.Tr>
                {["First", "Second", "Comparisons", "First chosen", "Second chosen", "Neither"].map((head) => (
                  <Table.Th key={head}>{head}</Table.Th>
                ))}
              </Table.Tr>
            </Table.Thead>
            <Table.Tbody>
              {data.pairs.map((pair) => (
                <Table.Tr key={`${pair.first} ${pair.second}`}>
                  <Table.Td>{labels.get(pair.first)}</Table.Td>
                  <Table.Td>{labels.get(pair.second)}</Table.Td>
                  {[pair.n, pair.first_chosen, pair.second_chosen, pair.ties].map((count, place) => (
                    <Table.Td key={place} className="number">
                      {count}
                    </Table.Td>
                  ))}
                </Table.Tr>
              ))}
            </Table.Tbody>
          </Table>
        </Table.ScrollContainer>
      </Card>
    </>
  );
}

function LevelCard({ name, data, factors }: { name: string; data: Data; factors: Factors }) {
  const options = useMemo(() => levelPlot(name, data, factors), [name, data, factors]);
  const { title } = labelsOf(factors, name);
  if (options === null) return null;
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        {title}
      </Title>
      <PlotFigure options={options} label={`How often each level of ${title} was chosen over the others`} />
    </Card>
  );
}
