import { Alert, Card, Group, SegmentedControl, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useMemo, useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { when, words } from "../ui/format";
import { PlotFigure } from "../ui/PlotFigure";
import { ClipResults } from "./ClipResults";
import { cellPlot, delayPlot, type Factors, labelsOf, marginPlot, timePlot } from "./plots";
import { Reports } from "./Reports";

type Phase = "pilot" | "live";

export function ResultsTab() {
  const { study = "" } = useParams({ strict: false });
  const detail = useQuery(studyQuery(study)).data;
  const [chosen, setPhase] = useState<Phase | null>(null);
  const phase = chosen ?? (detail?.summary.status === "pilot" ? "pilot" : "live");
  const results = useQuery({
    queryKey: ["results", study, phase],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/results", { params: { path: { study }, query: { phase } } })),
    refetchInterval: 15_000,
  });
  return (
    <Stack>
      <Group justify="space-between">
        <SegmentedControl
          aria-label="Data of"
          value={phase}
          onChange={(word) => setPhase(word === "pilot" ? "pilot" : "live")}
          data={[
            { value: "live", label: "Live" },
            { value: "pilot", label: "Pilot" },
          ]}
        />
      </Group>
      <Answer of={results}>
        {(data) =>
          data.ratings === 0 ? (
            <Text c="dimmed">No ratings yet{phase === "live" ? " while the study was live" : " while the study was a pilot"}.</Text>
          ) : (
            <Shown study={study} data={data} factors={detail?.design.factors ?? []} />
          )
        }
      </Answer>
      <Reports study={study} phase={phase} />
    </Stack>
  );
}

function Shown({ study, data, factors }: { study: string; data: Schemas["Results"]; factors: Factors }) {
  const singles = data.margins.filter((margin) => margin.factors.length <= 2);
  const cells = useMemo(() => cellPlot(data), [data]);
  const times = useMemo(() => timePlot(data), [data]);
  const delays = useMemo(() => delayPlot(data), [data]);
  return (
    <Stack>
      <Alert>
        {data.participants} participants, {data.ratings.toLocaleString()} ratings, counted {when(data.counted_at)}. These are means as data
        arrive, for a look at whether all is well; the analysis is the report below.
      </Alert>
      <SimpleGrid cols={{ base: 1, md: 2 }}>
        {singles.map((margin) => (
          <MarginCard key={margin.factors.join(":")} margin={margin} data={data} factors={factors} />
        ))}
        <Card withBorder>
          <Title order={2} size="h5">
            Answers in each cell
          </Title>
          <PlotFigure options={cells} label="Distribution of answers in each cell" />
        </Card>
        <Card withBorder>
          <Title order={2} size="h5">
            Response times from the clip's end
          </Title>
          <PlotFigure options={times} label="Histogram of response times" />
        </Card>
        <Card withBorder>
          <Title order={2} size="h5">
            How clips were shown
          </Title>
          <Counts title="Verdicts" counts={data.playback.verdicts} />
          <Counts title="Reasons" counts={data.playback.rules} />
          <Counts title="Played by" counts={data.playback.methods} />
          <PlotFigure options={delays} label="Histogram of the time from key to first frame" />
        </Card>
      </SimpleGrid>
      <ClipResults study={study} data={data} />
    </Stack>
  );
}

function Counts({ title, counts }: { title: string; counts: Record<string, number> }) {
  const entries = Object.entries(counts);
  if (entries.length === 0) return null;
  return (
    <Text size="sm">
      {title}: {entries.map(([word, count]) => `${words(word)} ${count.toLocaleString()}`).join(", ")}
    </Text>
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
