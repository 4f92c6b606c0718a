import { Anchor, Button, Card, Code, Group, SegmentedControl, SimpleGrid, Stack, Switch, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { studyQuery, useMay } from "../queries";
import { type DataOrigin, ORIGINS } from "../results/origins";
import { SeriesChooser } from "../ui/SeriesChooser";
import { CapsuleCard } from "./CapsuleCard";
import { SealCard } from "./SealCard";

const FILES: [file: string, title: string, words: string][] = [
  ["ratings.csv", "Answers", "Tidy CSV: one row a play, one column a factor, with how each clip was shown."],
  ["wide.csv", "Wide table", "One row a visit, as SPSS and JASP want it: a column a cell of the design, with its mean rating."],
  ["runs.csv", "Runs", "One row a visit: times, version, seed, exclusions, and a column a question of the forms."],
  ["ratings.sav", "Answers for SPSS", "One row a play, with labels of variables and levels."],
  ["wide.sav", "Wide table for SPSS", "One row a visit, with labels of variables and of the answers to forms."],
  ["ratings.parquet", "Answers as Parquet", "One row a play, with types and levels: for pandas, Polars, Arrow and DuckDB."],
  ["analysis.R", "Script for R", "Analyses the answers with afex, emmeans and lme4. Save it beside the answers."],
  ["analysis.py", "Script for Python", "Analyses the answers with pandas and statsmodels. Save it beside the answers."],
  [
    "psych-ds.zip",
    "Psych-DS dataset",
    "De-identified data, metadata, codebook, scripts and definition in the community's standard folder.",
  ],
  ["codebook.md", "Codebook", "What every column means, with type and unit."],
  ["raw.ndjson", "Raw data", "Everything stored, one JSON object a run: every drawn frame and its time."],
];

/** For owners alone; each download is in the audit log. */
const IDENTITIES: (typeof FILES)[number] = [
  "identities.csv",
  "Identities",
  "Recruiters’ ids beside the pseudonyms, for payment. Kept apart from all data, and noted in the audit log.",
];

type ExportOrigin = DataOrigin | "all";

const WHOSE: { value: ExportOrigin; label: string }[] = [...ORIGINS, { value: "all", label: "All together" }];

export function DataTab() {
  const { study = "" } = useParams({ strict: false });
  const [origin, setOrigin] = useState<ExportOrigin>("participant");
  const [series, setSeries] = useState<number | null>(null);
  const detail = useQuery(studyQuery(study)).data;
  const [excel, setExcel] = useState(false);
  const rated = detail?.definition.trial.kind === "clip_rating";
  const mine = useMay(study, "own") ? [...FILES, IDENTITIES] : FILES;
  const files = mine.filter(([file]) => rated || !file.startsWith("wide."));
  const version = detail?.summary.version ?? 1;
  const chosen = (file: string) => {
    const options = new URLSearchParams();
    const holdsData = !file.startsWith("analysis.") && file !== "identities.csv" && file !== "codebook.md";
    if (origin !== "participant" && holdsData) options.set("origin", origin);
    if (series !== null && holdsData) options.set("series", String(series));
    if (excel && file.endsWith(".csv")) options.set("excel", "true");
    return options.size > 0 ? `?${options.toString()}` : "";
  };
  const option = `${origin === "participant" ? "" : ` --origin ${origin}`}${series === null ? "" : ` --series ${series}`}`;
  const ofCapsule = origin === "all" ? option.replace(" --origin all", "") : option;
  return (
    <Stack>
      <Group>
        <SegmentedControl aria-label="Data of" value={origin} onChange={setOrigin} data={WHOSE} />
        <SeriesChooser every={detail?.series} chosen={series} choose={setSeries} without="every data series" />
        <Text size="sm">
          {origin === "all" ? "Data of all origins are told apart by the column run_origin. " : ""}
          {series === null && (detail?.series.length ?? 1) > 1 ? "The data series are told apart by the column data_series. " : ""}
          Excluded runs are in the files, marked in their column; previews and erased people are not.
        </Text>
      </Group>
      <Switch
        checked={excel}
        onChange={(event) => setExcel(event.currentTarget.checked)}
        label="For Excel"
        description="CSV files begin with a mark that shows Excel how letters are encoded. In every CSV file, an apostrophe before = + - @ keeps a text from running as a formula; analysis run removes it again."
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
        The same on the server's command line, and the analysis; the{" "}
        <Anchor underline="always" href={`/api/admin/studies/${study}/versions/${version}`} download={`${study}.toml`}>
          definition
        </Anchor>{" "}
        saved as {study}.toml:
      </Text>
      <Code
        block
        tabIndex={0}
        aria-label="Commands"
      >{`server export ${study}${option} --out ${study}.csv\nserver export ${study}${option} --format psych-ds --out ${study}.zip\nserver capsule ${study}${ofCapsule} --out ${study}-capsule.zip\nanalysis run ${study}.toml --csv ${study}.csv${option}`}</Code>
    </Stack>
  );
}
