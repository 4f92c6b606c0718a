import { Anchor, Button, Card, Code, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { studyQuery, useMay } from "../queries";

const FILES: [file: string, title: string, words: string][] = [
  ["ratings.csv", "Ratings", "Tidy CSV: one row a play, one column a factor, with how each clip was shown."],
  ["runs.csv", "Runs", "One row a visit: times, version, seed, exclusions, questionnaire."],
  ["psych-ds.zip", "Psych-DS dataset", "Data, metadata, codebook and definition in the community's standard folder."],
  ["codebook.md", "Codebook", "What every column means, with type and unit."],
  ["raw.ndjson", "Raw data", "Everything stored, one JSON object a run: every drawn frame and its time."],
];

/** For owners alone; each download is in the audit log. */
const IDENTITIES: (typeof FILES)[number] = [
  "identities.csv",
  "Identities",
  "Recruiters’ ids beside the pseudonyms, for payment. Kept apart from all data, and noted in the audit log.",
];

export function DataTab() {
  const { study = "" } = useParams({ strict: false });
  const detail = useQuery(studyQuery(study)).data;
  const files = useMay("owner") ? [...FILES, IDENTITIES] : FILES;
  const version = detail?.summary.version ?? 1;
  return (
    <Stack>
      <Text size="sm">
        Pilot and live data, excluded runs and simulated people are all in the files, each marked in its column; previews and erased people
        are not.
      </Text>
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
              href={`/api/admin/studies/${study}/data/${file}`}
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
      >{`server export ${study} --out ${study}.csv\nserver export ${study} --format psych-ds --out ${study}.zip\nanalysis run ${study}.toml --csv ${study}.csv`}</Code>
    </Stack>
  );
}
