/** Adaptive series: the answers at each stimulus, and the thresholds they led to. */

import { Card, SimpleGrid, Table, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../api";
import { fixed } from "../ui/format";
import { PlotFigure } from "../ui/PlotFigure";
import { HowShown } from "./HowShown";
import { type Factors, labelsOf } from "./plots";
import { seriesLabels, seriesPlot } from "./threshold-plots";

type Data = Schemas["ThresholdResults"];
type Series = Schemas["SeriesResult"];

export function ThresholdResults({ data, factors }: { data: Data; factors: Factors }) {
  const labels = useMemo(() => seriesLabels(data.series_results, factors), [data, factors]);
  const { title } = labelsOf(factors, data.factor);
  return (
    <>
      <SimpleGrid cols={{ base: 1, md: 2 }}>
        {data.series_results.map((series) => (
          <SeriesCard
            key={series.name}
            series={series}
            label={labels.get(series.name) ?? series.name}
            along={title}
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
          Of each person the latest estimate of the series; how sure it is, is the standard deviation of its posterior. The report fits the
          psychometric functions anew.
        </Text>
        <Table.ScrollContainer minWidth={480}>
          <Table>
            <Table.Thead>
              <Table.Tr>
                {["Series", "People", "Answers", "Mean threshold", "SD over people", "Posterior SD"].map((head) => (
                  <Table.Th key={head}>{head}</Table.Th>
                ))}
              </Table.Tr>
            </Table.Thead>
            <Table.Tbody>
              {data.series_results.map((series) => (
                <Table.Tr key={series.name}>
                  <Table.Td>{labels.get(series.name)}</Table.Td>
                  {[series.people, series.answers].map((count, place) => (
                    <Table.Td key={place} className="number">
                      {count.toLocaleString()}
                    </Table.Td>
                  ))}
                  {[series.mean, series.sd, series.mean_posterior_sd].map((value, place) => (
                    <Table.Td key={place} className="number">
                      {fixed(value)}
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

interface SeriesProps {
  series: Series;
  label: string;
  along: string;
  positive: string;
}

function SeriesCard({ series, label, along, positive }: SeriesProps) {
  const options = useMemo(() => seriesPlot(series, along, positive), [series, along, positive]);
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        {label}
      </Title>
      <Text size="sm">
        Share of {positive === "yes" ? "yes" : "right answers"} at each stimulus, larger where there are more answers. Ticks: people&apos;s
        thresholds; dashed: their mean.
      </Text>
      <PlotFigure options={options} label={`Share of positive answers along ${along}, ${label}`} />
    </Card>
  );
}
