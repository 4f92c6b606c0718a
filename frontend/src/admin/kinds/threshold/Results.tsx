/** Adaptive series: the answers at each stimulus, and the thresholds they led to. */

import { Card, SimpleGrid, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../../api";
import { type Column, DataTable } from "../../ui/DataTable";
import { fixed } from "../../ui/format";
import { PlotFigure } from "../../ui/PlotFigure";
import { seriesRows, type Factors, labelsOf, type ShownResults } from "../../results/plots";
import { HowShown } from "../../results/HowShown";
import { type Along, seriesLabels, seriesPlot } from "./plots";

type Data = Schemas["ThresholdResults"];
type Series = Schemas["SeriesResult"];

export function KindResults({ data, factors }: ShownResults) {
  return data.kind === "threshold" ? <ThresholdResults data={data} factors={factors} /> : null;
}

function ThresholdResults({ data, factors }: { data: Data; factors: Factors }) {
  const labels = useMemo(() => seriesLabels(data.series_results, factors), [data, factors]);
  const along = useMemo(() => alongOf(data, factors), [data, factors]);
  return (
    <>
      <SimpleGrid cols={{ base: 1, md: 2 }}>
        {data.series_results.map((series) => (
          <SeriesCard
            key={series.name}
            series={series}
            label={labels.get(series.name) ?? series.name}
            along={along}
            positive={data.two_interval ? "right" : "yes"}
          />
        ))}
        <HowShown data={data} />
      </SimpleGrid>
      <Card withBorder>
        <Title order={2} size="h5" mb="xs">
          Thresholds
        </Title>
        <Text size="sm">
          Latest estimate of each person's series. The posterior SD shows its uncertainty.{" "}
          {along.second && `It is the threshold at ${along.second.middle} along ${along.second.title}. `}
          The report fits the psychometric functions again.
        </Text>
        <DataTable
          label="Thresholds"
          rows={data.series_results}
          rowKey={({ name }) => name}
          columns={thresholdColumns(labels)}
          empty="No series."
        />
      </Card>
      {along.second && <Tilts series={data.series_results} labels={labels} along={along.title} second={along.second.title} />}
    </>
  );
}

interface TiltsProps {
  series: Series[];
  labels: Map<string, string>;
  along: string;
  second: string;
}

/** How the threshold moves along the second factor, with its interval. */
function Tilts({ series, labels, along, second }: TiltsProps) {
  return (
    <Card withBorder>
      <Title order={2} size="h5" mb="xs">
        Tilts
      </Title>
      <Text size="sm">
        How far the threshold in {along} moves per unit of {second}: the mean of each person&rsquo;s posterior, and its 95% t interval over
        people. Few answers draw it towards the middle of the declared tilts; the report fits it without.
      </Text>
      <DataTable label="Tilts" rows={series} rowKey={({ name }) => name} columns={tiltColumns(labels)} empty="No series." />
    </Card>
  );
}

function tiltColumns(labels: Map<string, string>): Column<Series>[] {
  return [
    { title: "Series", cell: ({ name }) => labels.get(name) },
    { title: "People", number: true, cell: ({ tilt }) => (tilt?.people ?? 0).toLocaleString() },
    { title: "Mean tilt", number: true, cell: ({ tilt }) => fixed(tilt?.mean) },
    { title: "95% CI", number: true, cell: ({ tilt }) => (tilt?.low == null ? "" : `${fixed(tilt.low)} to ${fixed(tilt.high)}`) },
    { title: "SD over people", number: true, cell: ({ tilt }) => fixed(tilt?.sd) },
    { title: "Posterior SD", number: true, cell: ({ tilt }) => fixed(tilt?.mean_posterior_sd) },
  ];
}

function alongOf(data: Data, factors: Factors): Along {
  const { second_factor, second_middle } = data;
  const second = second_factor === null ? null : { title: labelsOf(factors, second_factor).title, middle: second_middle ?? 0 };
  return { title: labelsOf(factors, data.factor).title, second };
}

function thresholdColumns(labels: Map<string, string>): Column<Series>[] {
  return [
    { title: "Series", cell: ({ name }) => labels.get(name) },
    { title: "People", number: true, cell: ({ people }) => people.toLocaleString() },
    { title: "Answers", number: true, cell: ({ answers }) => answers.toLocaleString() },
    { title: "Mean threshold", number: true, cell: ({ mean }) => fixed(mean) },
    { title: "SD over people", number: true, cell: ({ sd }) => fixed(sd) },
    { title: "Posterior SD", number: true, cell: ({ mean_posterior_sd }) => fixed(mean_posterior_sd) },
  ];
}

interface SeriesProps {
  series: Series;
  label: string;
  along: Along;
  positive: string;
}

function SeriesCard({ series, label, along, positive }: SeriesProps) {
  const titles = [along.title, along.second?.title].filter(Boolean).join(" and ");
  const options = useMemo(() => seriesPlot(series, along, positive), [series, along, positive]);
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        {label}
      </Title>
      <Text size="sm">
        Share of {positive === "yes" ? "yes" : "right answers"} at each stimulus, larger where there are more answers.{" "}
        {along.second ? "Cross: mean of people\u2019s thresholds." : "Ticks: people\u2019s thresholds; dashed: their mean."}
      </Text>
      <PlotFigure
        options={options}
        label={`Share of positive answers along ${titles}, ${label}`}
        rows={seriesRows(series, along.title, along.second?.title)}
      />
    </Card>
  );
}
