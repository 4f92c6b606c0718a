import {
  Button,
  Group,
  Text,
  Card,
  Code,
  CopyButton,
  Stack,
  Title,
  Anchor,
  Badge,
  Progress,
  Switch,
  SegmentedControl,
  Select,
} from "@mantine/core";
import { type Schemas, api, unwrap, useMay, studyQuery } from "../api";
import { counted, type DataOrigin, ORIGINS, when, originOf } from "../ui/format";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { Answer, onDemand } from "../ui/Answer";
import { useState } from "react";
import { useChange } from "../ui/useChange";
import { useParams } from "@tanstack/react-router";
import { SeriesChooser } from "../ui/SeriesChooser";

// Where else a study has visits of an origin: other data series, one press away.

interface ElsewhereProps {
  every: Schemas["SeriesOut"][];
  /** The data series that is shown. */
  shown: number;
  origin: DataOrigin;
  choose: (series: number) => void;
}

const PEOPLE: Record<DataOrigin, [one: string, several: string]> = {
  participant: ["participant is", "participants are"],
  pilot: ["pilot visit is", "pilot visits are"],
  simulated: ["simulated visit is", "simulated visits are"],
};

function elsewhere({ every, shown, origin }: Omit<ElsewhereProps, "choose">): Schemas["SeriesOut"][] {
  return every.filter(({ number, runs }) => number !== shown && (runs[origin] ?? 0) > 0);
}

function Elsewhere({ choose, ...of }: ElsewhereProps) {
  return elsewhere(of).map(({ number, name, runs }) => (
    <Group key={number} gap="xs">
      <Text>{`${counted(runs[of.origin] ?? 0, ...PEOPLE[of.origin])} in ${name}.`}</Text>
      <Button variant="default" size="xs" onClick={() => choose(number)}>
        Show them
      </Button>
    </Group>
  ));
}

interface MethodsProps {
  study: string;
  origin: DataOrigin;
  series: number | null;
  every: Schemas["SeriesOut"][];
  choose: (series: number) => void;
}

/** The Methods paragraph, to be copied; each number with the query that gives it. */
function MethodsCard({ study, origin, series, every, choose }: MethodsProps) {
  const [shown, { toggle }] = useDisclosure(false);
  const query = series === null ? { origin } : { origin, series };
  const methods = useQuery({
    queryKey: ["methods", study, origin, series],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/methods", { params: { path: { study }, query } })),
  });
  return (
    <Card withBorder>
      <Answer of={methods}>
        {(data) => (
          <Stack gap="sm">
            <Group justify="space-between" gap="sm">
              <Title order={2} size="h4">
                Methods paragraph
              </Title>
              <Group gap="xs">
                <Copy label="Copy text" value={data.paragraph} />
                <Copy label="Copy LaTeX" value={data.latex} />
                <Button variant="default" onClick={toggle} aria-expanded={shown}>
                  {shown ? "Hide sources" : "Show sources"}
                </Button>
              </Group>
            </Group>
            <Text>{data.paragraph}</Text>
            {(every.find(({ number }) => number === data.series)?.runs[origin] ?? 0) === 0 && (
              <Elsewhere every={every} shown={data.series} origin={origin} choose={choose} />
            )}
            <Text size="sm" c="dimmed">
              The methods files of a report list what each rule excluded.
            </Text>
            {shown && (
              <Code block tabIndex={0} aria-label="Sources of the numbers">
                {data.numbers.map((one) => `${one.name} = ${String(one.value)}\n  ${one.source}`).join("\n")}
              </Code>
            )}
          </Stack>
        )}
      </Answer>
    </Card>
  );
}

function Copy({ label, value }: { label: string; value: string }) {
  return (
    <CopyButton value={value}>
      {({ copied, copy }) => (
        <Button variant="default" onClick={copy}>
          {copied ? "Copied" : label}
        </Button>
      )}
    </CopyButton>
  );
}

// Nothing to show of one origin: whose runs there are instead, one press away.

interface NoAnswersProps {
  origin: DataOrigin;
  runs: Record<string, number>;
  every: Schemas["SeriesOut"][];
  series: number;
  choose: (origin: DataOrigin) => void;
  chooseSeries: (series: number) => void;
}

const OF: Record<DataOrigin, string> = { participant: "participants", pilot: "the pilot", simulated: "simulated people" };

function NoAnswers({ origin, runs, every, series, choose, chooseSeries }: NoAnswersProps) {
  if (elsewhere({ every, shown: series, origin }).length > 0)
    return (
      <Stack gap="xs">
        <Text c="dimmed">Data series {series} has no answers yet.</Text>
        <Elsewhere every={every} shown={series} origin={origin} choose={chooseSeries} />
      </Stack>
    );
  const others = ORIGINS.filter(({ value }) => value !== origin && (runs[value] ?? 0) > 0);
  const listed = others.map(({ value }) => `${OF[value]} (${counted(runs[value] ?? 0, "run")})`).join(" and ");
  return (
    <Group>
      <Text c="dimmed">
        No answers from {OF[origin]} yet{others.length > 0 && `, only from ${listed}`}. Charts appear here with the first answer.
      </Text>
      {others.map(({ value, label }) => (
        <Button key={value} variant="default" size="xs" onClick={() => choose(value)}>
          Show {label.toLowerCase()}
        </Button>
      ))}
    </Group>
  );
}

function Reports({ study, origin, series }: { study: string; origin: DataOrigin; series: number | null }) {
  const path = { params: { path: { study } } };
  const [sensitivity, setSensitivity] = useState(true);
  const mayBuild = useMay(study, "run");
  const mayOpen = useMay(study, "export");
  const reports = useQuery({
    queryKey: ["reports", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/reports", path)),
    refetchInterval: (query) => (query.state.data?.some(isUnderWay) ? 1_000 : false),
  });
  const build = useChange(
    () => unwrap(api.POST("/api/admin/studies/{study}/reports", { ...path, body: { origin, series, sensitivity } })),
    { touches: [["reports", study]] },
  );
  return (
    <Card withBorder>
      <Group justify="space-between" mb="sm" gap="sm">
        <Title order={2} size="h4">
          Analysis reports
        </Title>
        {mayBuild && (
          <Group>
            <Switch
              label="with mixed and ordinal models"
              checked={sensitivity}
              onChange={(event) => setSensitivity(event.currentTarget.checked)}
            />
            <Button onClick={() => build.mutate(undefined)} loading={build.isPending}>
              Build a report
            </Button>
          </Group>
        )}
      </Group>
      <Answer of={reports}>
        {(rows) =>
          rows.length === 0 ? (
            <Text c="dimmed">None yet. Build one for the tables, figures and analysis of this study.</Text>
          ) : (
            <Stack gap="xs">
              {rows.map((row) => (
                <Report key={row.id} study={study} report={row} mayOpen={mayOpen} />
              ))}
            </Stack>
          )
        }
      </Answer>
    </Card>
  );
}

function isUnderWay(report: Schemas["ReportOut"]): boolean {
  return report.status === "queued" || report.status === "running";
}

function Report({ study, report, mayOpen }: { study: string; report: Schemas["ReportOut"]; mayOpen: boolean }) {
  const address = (file: string) => `/api/admin/studies/${study}/reports/${report.id}/${file}`;
  return (
    <Group gap="sm">
      <Badge color={report.status === "failed" ? "red.9" : report.status === "done" ? "teal.9" : "gray.7"}>{report.status}</Badge>
      <Text size="sm">
        {when(report.created_at)}, {report.origin}
        {report.series != null && `, series ${report.series}`}
      </Text>
      {isUnderWay(report) && <Progress w={160} value={100 * report.progress} animated aria-label={report.message} />}
      {report.status === "failed" && <Text size="sm">{report.message}</Text>}
      {mayOpen &&
        report.files.map((file) => (
          <Anchor key={file} href={address(file)} target="_blank" rel="noopener" size="sm">
            {file}
          </Anchor>
        ))}
      {!mayOpen && report.files.length > 0 && <Text size="sm">Its files contain individual data; the right “export” is required.</Text>}
    </Group>
  );
}

const OfKind = onDemand(async () => (await import("./OfKind")).OfKind);

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
        <SeriesChooser
          every={detail?.series}
          chosen={series}
          choose={(number) => {
            setSeries(number);
            setScale(null);
          }}
          without="series of the active version"
        />
        {results.data !== undefined && "scales" in results.data && (
          <ScaleChooser scales={results.data.scales} chosen={results.data.scale.name} choose={setScale} />
        )}
      </Group>
      <Answer of={results}>
        {(data) =>
          data.ratings === 0 ? (
            <NoAnswers
              origin={origin}
              runs={detail?.series.find((one) => one.number === data.series)?.runs ?? {}}
              every={detail?.series ?? []}
              series={data.series}
              choose={setOrigin}
              chooseSeries={setSeries}
            />
          ) : (
            <Stack>
              <Elsewhere every={detail?.series ?? []} shown={data.series} origin={origin} choose={setSeries} />
              <OfKind study={study} data={data} factors={detail?.design.factors ?? []} />
            </Stack>
          )
        }
      </Answer>
      <Reports study={study} origin={origin} series={series} />
      <MethodsCard study={study} origin={origin} series={series} every={detail?.series ?? []} choose={setSeries} />
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
