import { Alert, Card, Group, SegmentedControl, Select, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useMemo, useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { when } from "../ui/format";
import { PlotFigure } from "../ui/PlotFigure";
import { ClipResults } from "./ClipResults";
import { HowShown } from "./HowShown";
import { PairResults } from "./PairResults";
import { type DataOrigin, ORIGINS, originOf } from "./origins";
import { MethodsCard } from "./MethodsCard";
import { type AnyResults, cellPlot, type Factors, labelsOf, marginPlot } from "./plots";
import { NoAnswers } from "./NoAnswers";
import { Reports } from "./Reports";
import { ThresholdResults } from "./ThresholdResults";
import { TraceResults } from "./TraceResults";

export function ResultsTab() {
  const { study = "" } = useParams({ strict: false });
  const detail = useQuery(studyQuery(study)).data;
  const [chosen, setOrigin] = useState<DataOrigin | null>(null);
  const [series, setSeries] = useState<number | null>(null);
  const [scale, setScale] = useState<string | null>(null);
  const origin = chosen ?? (detail?.summary.status === "pilot" ? "pilot" : "participant");
  const results = useQuery({
    queryKey: ["results", study, origin, series, scale],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/results", { params: { path: { study }, query: { origin, series, scale } } })),
    refetchInterval: 15_000,
  });
  return (
    <Stack>
      <Group justify="space-between">
        <SegmentedControl aria-label="Data of" value={origin} onChange={(word) => setOrigin(originOf(word))} data={ORIGINS} />
        {detail !== undefined && detail.series.length > 1 && (
          <Select
            aria-label="Data series"
            w={280}
            clearable
            placeholder="series of the active version"
            value={series === null ? null : String(series)}
            onChange={(word) => {
              setSeries(word === null ? null : Number(word));
              setScale(null);
            }}
            data={detail.series.map((one) => ({ value: String(one.number), label: one.name }))}
          />
        )}
        {results.data?.kind === "clip_rating" && (
          <ScaleChooser scales={results.data.scales} chosen={results.data.scale.name} choose={setScale} />
        )}
      </Group>
      <Answer of={results}>
        {(data) =>
          data.ratings === 0 ? (
            <NoAnswers origin={origin} runs={detail?.series.find((one) => one.number === data.series)?.runs ?? {}} choose={setOrigin} />
          ) : (
            <OfKind study={study} data={data} factors={detail?.design.factors ?? []} />
          )
        }
      </Answer>
      <Reports study={study} origin={origin} series={series} />
      <MethodsCard study={study} origin={origin} series={series} />
    </Stack>
  );
}

interface ChooserProps {
  scales: Schemas["ResultScale"][];
  chosen: string;
  choose: (name: string | null) => void;
}

/** The scales of a study that has several; one that is reverse-keyed says so, its answers are as they were given. */
function ScaleChooser({ scales, chosen, choose }: ChooserProps) {
  if (scales.length < 2) return null;
  const data = scales.map(({ name, reverse }) => ({ value: name, label: reverse ? `${name} (reverse-keyed)` : name }));
  return <Select aria-label="Scale" w={240} allowDeselect={false} value={chosen} onChange={choose} data={data} />;
}

interface ShownProps<Results> {
  study: string;
  data: Results;
  factors: Factors;
}

/** The results as the study's kind of trial shows them. */
function OfKind({ study, data, factors }: ShownProps<AnyResults>) {
  return (
    <Stack>
      <Alert>
        Data series {data.series}, {data.origin}: {data.participants} runs, {data.ratings.toLocaleString()} answers, counted{" "}
        {when(data.counted_at)}. {data.origin === "simulated" && "These are simulated people: nobody gave these answers. "}This is what
        arrives, for a look at whether all is well; the analysis is the report below.
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
  return (
    <Card withBorder>
      <Title order={2} size="h5">
        Answers in each cell
      </Title>
      <PlotFigure options={cells} label="Distribution of answers in each cell" />
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
      <PlotFigure options={options} label={`Marginal means of ${title} with within-participant error bars`} />
    </Card>
  );
}
