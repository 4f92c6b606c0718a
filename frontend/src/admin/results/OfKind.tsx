/** The results as the study's kind of trial shows them, charts and all: loaded once there are answers. */
import { Alert, Card, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../api";
import { counted, when, labelOfOrigin } from "../ui/format";
import { PlotFigure } from "../ui/PlotFigure";
import { ClipResults } from "./ClipResults";
import { cellRows, marginRows } from "./figure-rows";
import { HowShown } from "./HowShown";
import { PairResults } from "./PairResults";
import { type AnyResults, cellPlot, type Factors, labelsOf, marginPlot } from "./plots";
import { ThresholdResults } from "./ThresholdResults";
import { TraceResults } from "./TraceResults";
import { useCellLabels } from "./useCellLabels";

interface ShownProps<Results> {
  study: string;
  data: Results;
  factors: Factors;
}

export function OfKind({ study, data, factors }: ShownProps<AnyResults>) {
  return (
    <Stack>
      <Alert>
        Data series {data.series}, {labelOfOrigin(data.origin).toLowerCase()}: {counted(data.participants, "run")} with answers,{" "}
        {counted(data.ratings, "answer")}, counted {when(data.counted_at)}.{" "}
        {data.origin === "simulated" && "These are simulated people: nobody gave these answers. "}This is what arrives, for a look at
        whether all is well; the analysis is the report below.
      </Alert>
      {data.kind === "clip_rating" && <Shown study={study} data={data} factors={factors} />}
      {data.kind === "paired_comparison" && <PairResults data={data} factors={factors} />}
      {data.kind === "threshold" && <ThresholdResults data={data} factors={factors} />}
      {data.kind === "continuous_rating" && <TraceResults data={data} factors={factors} />}
      {data.kind === "other" && (
        <>
          <Text>{data.note}</Text>
          <SimpleGrid cols={{ base: 1, md: 2 }}>
            <HowShown data={data} />
          </SimpleGrid>
        </>
      )}
    </Stack>
  );
}

function Shown({ study, data, factors }: ShownProps<Schemas["Results"]>) {
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
        Answers in each cell
      </Title>
      <PlotFigure options={cells} label="Distribution of answers in each cell" rows={cellRows(data, labels)} />
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
