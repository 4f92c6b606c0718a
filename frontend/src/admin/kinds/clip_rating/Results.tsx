/** Ratings of single clips: the means of each level, the answers in each cell, and every clip with its answers. */

import { Card, Group, ScrollArea, SimpleGrid, Stack, Table, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useMemo, useState } from "react";
import { type Schemas, clipsQuery } from "../../api";
import { ClipCard } from "../../clips/ClipCard";
import { fixed } from "../../ui/format";
import { PlotFigure } from "../../ui/PlotFigure";
import { cellRows, marginRows, cellPlot, type Factors, labelsOf, marginPlot, type ShownResults, useCellLabels } from "../../results/plots";
import { HowShown } from "../../results/HowShown";

type Clip = Schemas["ClipResult"];
const keyOf = (clip: Clip) => `${clip.cell} ${String(clip.exemplar)} ${clip.clip_sha256}`;

/** In the order of the declaration's levels, which the labels have; clips of one cell by their exemplar. */
function byCells(clips: readonly Clip[], labels: ReadonlyMap<string, string>): Clip[] {
  const rank = new Map([...labels.keys()].map((cell, index) => [cell, index]));
  return clips.toSorted((a, b) => (rank.get(a.cell) ?? 0) - (rank.get(b.cell) ?? 0) || a.exemplar - b.exemplar);
}

export function KindResults({ study, data, factors }: ShownResults) {
  return data.kind === "clip_rating" ? <RatingResults study={study} data={data} factors={factors} /> : null;
}

function RatingResults({ study, data, factors }: { study: string; data: Schemas["Results"]; factors: Factors }) {
  const singles = data.margins.filter((margin) => margin.factors.length <= 2);
  return (
    <Stack>
      <SimpleGrid cols={{ base: 1, md: 2 }}>
        {singles.map((margin) => (
          <MarginCard key={margin.factors.join(":")} margin={margin} data={data} factors={factors} />
        ))}
        <CellCard data={data} factors={factors} />
        <HowShown data={data} />
      </SimpleGrid>
      <ClipResults study={study} data={data} factors={factors} />
    </Stack>
  );
}

function CellCard({ data, factors }: { data: Schemas["Results"]; factors: Factors }) {
  const cells = useMemo(() => cellPlot(data, factors), [data, factors]);
  const labels = useCellLabels(data.cells, factors);
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        Responses per cell
      </Title>
      <PlotFigure options={cells} label="Distribution of responses in each cell" rows={cellRows(data, labels)} />
    </Card>
  );
}

interface MarginProps {
  margin: Schemas["Margin"];
  data: Schemas["Results"];
  factors: Factors;
}

function MarginCard({ margin, data, factors }: MarginProps) {
  const options = useMemo(() => marginPlot(margin, data, factors), [margin, data, factors]);
  const title = margin.factors.map((name) => labelsOf(factors, name).title).join(" x ");
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        {title}
      </Title>
      <PlotFigure
        options={options}
        label={`Marginal means of ${title} with within-participant error bars`}
        rows={marginRows(margin, factors)}
      />
    </Card>
  );
}

/** Every clip with its answers; the chosen one plays next to them. */
function ClipResults({ study, data, factors }: { study: string; data: Schemas["Results"]; factors: Factors }) {
  const clips = useQuery(clipsQuery(study));
  const labels = useCellLabels(data.clips, factors);
  const [chosen, setChosen] = useState("");
  const inOrder = useMemo(() => byCells(data.clips, labels), [data.clips, labels]);
  const current = inOrder.find((clip) => keyOf(clip) === chosen) ?? inOrder[0];
  const shown = clips.data?.find((clip) => clip.clip_sha256 === current?.clip_sha256 && clip.cell === current.cell);
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Each clip
      </Title>
      <Group align="start" wrap="wrap">
        <ScrollArea h={420} flex="1 1 300px" viewportProps={{ tabIndex: 0, "aria-label": "Clips" }}>
          <Table stickyHeader>
            <Table.Thead>
              <Table.Tr>
                <Table.Th>Clip</Table.Th>
                <Table.Th>Ratings</Table.Th>
                <Table.Th>Mean</Table.Th>
                <Table.Th className="only-wide">
                  Answers from {data.scale.minimum} to {data.scale.maximum}
                </Table.Th>
              </Table.Tr>
            </Table.Thead>
            <Table.Tbody>
              {inOrder.map((clip) => (
                <Table.Tr key={keyOf(clip)} bg={clip === current ? "var(--mantine-color-default-hover)" : ""}>
                  <Table.Td>
                    <button type="button" className="line-link" aria-pressed={clip === current} onClick={() => setChosen(keyOf(clip))}>
                      {labels.get(clip.cell)}, no. {clip.exemplar}
                    </button>
                  </Table.Td>
                  <Table.Td className="number">{clip.ratings}</Table.Td>
                  <Table.Td className="number">{fixed(clip.mean)}</Table.Td>
                  <Table.Td className="only-wide">
                    <Bars counts={clip.counts} bins={data.bins} />
                  </Table.Td>
                </Table.Tr>
              ))}
            </Table.Tbody>
          </Table>
        </ScrollArea>
        <Stack flex="1 1 300px" maw={460}>
          {shown === undefined ? (
            <Text c="dimmed">This clip belongs to an earlier version of the study.</Text>
          ) : (
            <ClipCard key={shown.url} study={study} clip={shown} label={labels.get(shown.cell)} />
          )}
        </Stack>
      </Group>
    </Card>
  );
}

/** How often each answer was given: small bars, with the counts for those who hear the page. */
function Bars({ counts, bins }: { counts: number[]; bins: number[] }) {
  const most = Math.max(1, ...counts);
  const label = counts.map((count, bin) => `${bins[bin] ?? ""}: ${count}`).join(", ");
  return (
    <svg width={14 * counts.length} height={22} role="img" aria-label={label}>
      <title>{label}</title>
      {counts.map((count, bin) => (
        <rect
          key={bin}
          x={14 * bin}
          y={21 - (20 * count) / most}
          width={11}
          height={(20 * count) / most + 1}
          fill="var(--mantine-primary-color-filled)"
        />
      ))}
    </svg>
  );
}
