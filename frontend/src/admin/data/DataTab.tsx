import { adminKind } from "../kinds";
import {
  Badge,
  Button,
  Card,
  Code,
  Group,
  Progress,
  Stack,
  Switch,
  Text,
  Title,
  FileInput,
  Anchor,
  SegmentedControl,
  SimpleGrid,
} from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap, useMay, sealQuery, studyQuery } from "../api";
import { type DataOrigin, when, counted, ORIGINS } from "../ui/format";
import { Answer } from "../ui/Answer";
import { CopyId } from "../ui/CopyId";
import { ConfirmButton } from "../ui/ConfirmButton";
import { useChange, notify } from "../ui/useChange";
import { useParams } from "@tanstack/react-router";
import { SeriesChooser } from "../ui/SeriesChooser";

// The capsule of a study: made in the background, downloaded, and verifiable by anyone who has it.

const isUnderWay = ({ status }: Schemas["CapsuleOut"]) => status === "queued" || status === "running";

function CapsuleCard({ study, origin, series }: { study: string; origin: DataOrigin; series: number | null }) {
  const path = { params: { path: { study } } };
  const [clips, setClips] = useState(true);
  const [sensitivity, setSensitivity] = useState(true);
  const mayMake = useMay(study, "run");
  const mayOpen = useMay(study, "export");
  const capsules = useQuery({
    queryKey: ["capsules", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/capsules", path)),
    refetchInterval: ({ state }) => (state.data?.some(isUnderWay) ? 1_000 : false),
  });
  const make = useChange(
    () => unwrap(api.POST("/api/admin/studies/{study}/capsules", { ...path, body: { origin, series, clips, sensitivity } })),
    { touches: [["capsules", study]] },
  );
  const busy = capsules.data?.some(isUnderWay) ?? false;
  return (
    <Card withBorder>
      <Title order={2} size="h4">
        Capsule
      </Title>
      <Text size="sm" mt={4} mb="md" maw={720}>
        Everything you can share, in one zip: de-identified data, clips, definition, sealed plan, report and software versions, as Psych-DS
        and RO-Crate. Anyone can regenerate the report with <Code>analysis verify</Code>. Its report covers one data series: the one chosen
        above, otherwise that of the active version.
      </Text>
      {mayMake && (
        <Group mb="sm">
          <Switch label="with the clips" checked={clips} onChange={(event) => setClips(event.currentTarget.checked)} />
          <Switch
            label="with mixed and ordinal models"
            checked={sensitivity}
            onChange={(event) => setSensitivity(event.currentTarget.checked)}
          />
          <Button onClick={() => make.mutate(undefined)} loading={make.isPending} disabled={busy}>
            Create capsule
          </Button>
        </Group>
      )}
      <Answer of={capsules}>
        {(rows) => (
          <Stack gap="xs" role="status" aria-label="Capsules">
            {rows.map((capsule) => (
              <One key={capsule.id} study={study} capsule={capsule} mayOpen={mayOpen} mayRemove={mayMake} />
            ))}
          </Stack>
        )}
      </Answer>
    </Card>
  );
}

interface OneProps {
  study: string;
  capsule: Schemas["CapsuleOut"];
  mayOpen: boolean;
  mayRemove: boolean;
}

function One({ study, capsule, mayOpen, mayRemove }: OneProps) {
  const { id, status, progress, message, bytes, sha256 } = capsule;
  const remove = useChange(
    () => unwrap(api.DELETE("/api/admin/studies/{study}/capsules/{capsule}", { params: { path: { study, capsule: id } } })),
    { touches: [["capsules", study]], done: "Capsule deleted." },
  );
  return (
    <Group gap="sm">
      <Badge color={status === "failed" ? "red.9" : status === "done" ? "teal.9" : "gray.7"}>{status}</Badge>
      <Text size="sm">
        {when(capsule.created_at)}, {capsule.origin}
        {capsule.series != null && `, series ${capsule.series}`}
        {!capsule.clips && ", without clips"}
      </Text>
      {isUnderWay(capsule) && (
        <>
          <Progress w={160} value={100 * progress} animated aria-label="Progress of the capsule" />
          <Text size="sm">{message}</Text>
        </>
      )}
      {status === "failed" && <Text size="sm">{message}</Text>}
      {bytes != null && mayOpen && (
        <Button component="a" size="compact-sm" variant="default" href={`/api/admin/studies/${study}/capsules/${id}.zip`} download>
          Download ({(bytes / 2 ** 20).toFixed(1)} MiB)
        </Button>
      )}
      {sha256 != null && (
        <Text size="xs" c="dimmed">
          SHA-256 <CopyId value={sha256} what="SHA-256" />
        </Text>
      )}
      {mayRemove && !isUnderWay(capsule) && (
        <ConfirmButton
          size="compact-sm"
          label="Delete"
          question={`The capsule of ${when(capsule.created_at)} is deleted permanently. The data stay; you can create another capsule.`}
          confirm="Delete the capsule"
          onConfirm={() => remove.mutate(undefined)}
        />
      )}
    </Group>
  );
}

// The plan of the study, sealed before its first participant.

function SealCard({ study }: { study: string }) {
  const seal = useQuery(sealQuery(study));
  return (
    <Card withBorder>
      <Title order={2} size="h4">
        Sealed plan
      </Title>
      <Text size="sm" mt={4} mb="sm">
        Design, exclusions, analysis plan and power, fixed with a hash before the first participant. Reports list every deviation.
      </Text>
      <Answer of={seal}>
        {(record) => (record.sealed_at === null ? <Unsealed study={study} seal={record} /> : <Sealed study={study} seal={record} />)}
      </Answer>
    </Card>
  );
}

interface Props {
  study: string;
  seal: Schemas["SealOut"];
}

function Sealed({ study, seal }: Props) {
  const address = (ending: string) => `/api/admin/studies/${study}/seal/plan.${ending}`;
  return (
    <Stack gap="xs">
      <Text size="sm" className="wrap-anywhere">
        Version {seal.version} was sealed {when(seal.sealed_at ?? "")}, {seal.power ? "with its power" : "without power"}; SHA-256{" "}
        {seal.sha256 != null && <CopyId value={seal.sha256} what="SHA-256" />}
      </Text>
      <Group>
        <Button component="a" variant="default" size="xs" href={address("json")} download>
          Sealed file (JSON)
        </Button>
        <Button component="a" variant="default" size="xs" href={address("html")} download>
          Page to print
        </Button>
      </Group>
    </Stack>
  );
}

function Unsealed({ study, seal }: Props) {
  const mayChange = useMay(study, "edit");
  const [power, setPower] = useState<Record<string, unknown> | null>(null);
  const make = useChange(() => unwrap(api.POST("/api/admin/studies/{study}/seal", { params: { path: { study } }, body: { power } })), {
    touches: [["study", study, "seal"]],
    done: "Plan sealed.",
  });
  if (seal.participants > 0) {
    const have = counted(seal.participants, "participant has", "participants have");
    return <Text size="sm">The plan can no longer be sealed: {have} already started.</Text>;
  }
  if (!mayChange) return <Text size="sm">Not sealed yet.</Text>;
  return (
    <Group align="end">
      <FileInput
        label="Power (optional)"
        description="JSON that analysis power --json wrote"
        accept=".json"
        clearable
        w={300}
        onChange={(file) => void readObject(file).then(setPower)}
      />
      <ConfirmButton
        label="Seal the plan"
        question="A seal is permanent. Reports are compared with what this version declares."
        confirm="Seal"
        harmless
        onConfirm={() => make.mutate(undefined)}
      />
    </Group>
  );
}

/** The JSON object in a file; null, after a message, if there is none. */
async function readObject(file: File | null): Promise<Record<string, unknown> | null> {
  if (file === null) return null;
  try {
    const parsed: unknown = JSON.parse(await file.text());
    if (typeof parsed === "object" && parsed !== null && !Array.isArray(parsed)) return { ...parsed };
  } catch {
    // Said below, as for JSON of another kind.
  }
  notify({
    title: "Not the file of a power analysis",
    message: `${file.name}: expected the JSON of analysis power, got another file.`,
    color: "red",
  });
  return null;
}

const FILES: [file: string, title: string, words: string][] = [
  ["ratings.csv", "Answers", "Tidy CSV: one row per presentation, one column per factor, with playback details."],
  ["wide.csv", "Wide table", "One row per participant and one column per cell with its mean rating, as SPSS and JASP expect."],
  ["runs.csv", "Runs", "One row per participant: times, version, seed, exclusions, and one column per form question."],
  ["ratings.sav", "Answers for SPSS", "One row per presentation, with labels of variables and levels."],
  ["wide.sav", "Wide table for SPSS", "One row per participant, with labels of variables and form answers."],
  ["ratings.parquet", "Answers as Parquet", "One row per presentation, with types and levels, for pandas, Polars, Arrow and DuckDB."],
  ["analysis.R", "Script for R", "Analyzes the answers with afex, emmeans and lme4. Save it next to the answers."],
  ["analysis.py", "Script for Python", "Analyzes the answers with pandas and statsmodels. Save it next to the answers."],
  [
    "psych-ds.zip",
    "Psych-DS dataset",
    "De-identified data, metadata, codebook, scripts and definition in the community's standard folder.",
  ],
  ["codebook.md", "Codebook", "What every column means, with type and unit."],
  ["raw.ndjson", "Raw data", "One JSON object per run: each play with its answer and every drawn frame, events, forms and calibrations."],
];

/** For owners alone; each download is in the audit log. */
const IDENTITIES: (typeof FILES)[number] = [
  "identities.csv",
  "Identities",
  "Recruiter IDs with their pseudonyms, for payment. Stored separately; each download is in the audit log.",
];

type ExportOrigin = DataOrigin | "all";

const WHOSE: { value: ExportOrigin; label: string }[] = [...ORIGINS, { value: "all", label: "All together" }];

export function DataTab() {
  const { study = "" } = useParams({ strict: false });
  const [origin, setOrigin] = useState<ExportOrigin>("participant");
  const [series, setSeries] = useState<number | null>(null);
  const detail = useQuery(studyQuery(study)).data;
  const [excel, setExcel] = useState(false);
  const [oldOrder, setOldOrder] = useState(false);
  const hasWide = detail !== undefined && adminKind(detail.definition.trial.kind).hasWideTable === true;
  const mine = useMay(study, "own") ? [...FILES, IDENTITIES] : FILES;
  const files = mine.filter(([file]) => hasWide || !file.startsWith("wide."));
  const version = detail?.summary.version ?? 1;
  const chosen = (file: string) => {
    const options = new URLSearchParams();
    const holdsData = !file.startsWith("analysis.") && file !== "identities.csv" && file !== "codebook.md";
    if (origin !== "participant" && holdsData) options.set("origin", origin);
    if (series !== null && holdsData) options.set("series", String(series));
    if (excel && file.endsWith(".csv")) options.set("excel", "true");
    if (oldOrder && holdsData && file !== "raw.ndjson") options.set("old_order", "true");
    return options.size > 0 ? `?${options.toString()}` : "";
  };
  const option = `${origin === "participant" ? "" : ` --origin ${origin}`}${series === null ? "" : ` --series ${series}`}`;
  const order = oldOrder ? " --old-order" : "";
  const ofCapsule = origin === "all" ? option.replace(" --origin all", "") : option;
  return (
    <Stack>
      <Group>
        <SegmentedControl aria-label="Data of" value={origin} onChange={setOrigin} data={WHOSE} />
        <SeriesChooser every={detail?.series} chosen={series} choose={setSeries} without="every data series" />
        <Text size="sm">
          {origin === "all" ? "The column run_origin identifies the origin. " : ""}
          {series === null && (detail?.series.length ?? 1) > 1 ? "The column data_series identifies the data series. " : ""}
          Files include excluded runs, marked in the column “excluded”, but no previews and no erased participants.
        </Text>
      </Group>
      <Switch
        checked={excel}
        onChange={(event) => setExcel(event.currentTarget.checked)}
        label="For Excel"
        description="CSV files start with a byte order mark so that Excel reads special characters correctly. In every CSV file, an apostrophe before = + - @ keeps texts from running as formulas; analysis run removes it."
      />
      <Switch
        checked={oldOrder}
        onChange={(event) => setOldOrder(event.currentTarget.checked)}
        label="Old column order"
        description="For programs that read columns by position. The new order keeps related columns together."
      />
      <SealCard study={study} />
      <CapsuleCard study={study} origin={origin === "all" ? "participant" : origin} series={series} />
      <SimpleGrid cols={{ base: 1, sm: 2, lg: 3 }}>
        {files.map(([file, title, words]) => (
          <Card withBorder key={file}>
            <Title order={2} size="h4">
              {title}
            </Title>
            <Text size="sm" mt={4} mb="md">
              {words}
            </Text>
            <Button
              component="a"
              variant="default"
              mt="auto"
              style={{ alignSelf: "flex-start" }}
              href={`/api/admin/studies/${study}/data/${file}${chosen(file)}`}
              download
            >
              Download {file}
            </Button>
          </Card>
        ))}
      </SimpleGrid>
      <Text size="sm">
        These commands download the same files and run the analysis. First save the{" "}
        <Anchor underline="always" href={`/api/admin/studies/${study}/versions/${version}`} download={`${study}.toml`}>
          definition
        </Anchor>{" "}
        as {study}.toml.
      </Text>
      <Code
        block
        tabIndex={0}
        aria-label="Commands"
      >{`server export ${study}${option} --out ${study}.csv${order}\nserver export ${study}${option}${order} --format psych-ds --out ${study}.zip\nserver capsule ${study}${ofCapsule} --out ${study}-capsule.zip\nanalysis run ${study}.toml --csv ${study}.csv${option}`}</Code>
    </Stack>
  );
}
