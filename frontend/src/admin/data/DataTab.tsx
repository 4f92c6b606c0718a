import { Anchor, Card, Code, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useParams } from "@tanstack/react-router";

const FILES: [file: string, title: string, words: string][] = [
  ["ratings.csv", "Ratings", "Tidy CSV: one row a play, one column a factor, with how each clip was shown."],
  ["runs.csv", "Runs", "One row a visit: times, version, seed, exclusions, questionnaire."],
  ["psych-ds.zip", "Psych-DS dataset", "Data, metadata, codebook and definition in the community's standard folder."],
  ["codebook.md", "Codebook", "What every column means, with type and unit."],
  ["raw.ndjson", "Raw data", "Everything stored, one JSON object a run: every drawn frame and its time."],
];

export function DataTab() {
  const { study = "" } = useParams({ strict: false });
  return (
    <Stack>
      <SimpleGrid cols={{ base: 1, sm: 2, lg: 3 }}>
        {FILES.map(([file, title, words]) => (
          <Card withBorder key={file}>
            <Title order={2} size="h4">
              {title}
            </Title>
            <Text size="sm" my="xs">
              {words}
            </Text>
            <Anchor href={`/api/admin/studies/${study}/data/${file}`} download>
              Download {file}
            </Anchor>
          </Card>
        ))}
      </SimpleGrid>
      <Text size="sm">On the server's command line:</Text>
      <Code block>{`server export ${study} --out ${study}.csv\nanalysis run definition.toml --csv ${study}.csv`}</Code>
    </Stack>
  );
}
