/** Paired comparisons: what was chosen between cells, and how often each level was. */

import { Card, SimpleGrid, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../../api";
import { type Column, DataTable } from "../../ui/DataTable";
import { PlotFigure } from "../../ui/PlotFigure";
import { choiceRows, levelRows, type Factors, labelsOf, type ShownResults } from "../../results/plots";
import { HowShown } from "../../results/HowShown";
import { choicePlot, comparedCells, levelPlot } from "./plots";

type Data = Schemas["PairResults"];

export function KindResults({ data, factors }: ShownResults) {
  return data.kind === "paired_comparison" ? <PairResults data={data} factors={factors} /> : null;
}

function PairResults({ data, factors }: { data: Data; factors: Factors }) {
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
            Share of comparisons in which the row was chosen over the column (columns are numbered like rows). A tie counts one half for
            each.
          </Text>
          <PlotFigure options={choices} label="Share of choices in each pair of cells" rows={choiceRows(data, labels)} />
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
        <DataTable
          label="Each pair of cells"
          rows={data.pairs}
          rowKey={({ first, second }) => `${first} ${second}`}
          columns={pairColumns(labels)}
          empty="No comparisons."
        />
      </Card>
    </>
  );
}

function pairColumns(labels: Map<string, string>): Column<Data["pairs"][number]>[] {
  return [
    { title: "First", cell: ({ first }) => labels.get(first) },
    { title: "Second", cell: ({ second }) => labels.get(second) },
    { title: "Comparisons", number: true, cell: ({ n }) => n },
    { title: "First chosen", number: true, cell: ({ first_chosen }) => first_chosen },
    { title: "Second chosen", number: true, cell: ({ second_chosen }) => second_chosen },
    { title: "Neither", number: true, cell: ({ ties }) => ties },
  ];
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
      <PlotFigure
        options={options}
        label={`How often each level of ${title} was chosen over the others`}
        rows={levelRows(name, data, factors)}
      />
    </Card>
  );
}
