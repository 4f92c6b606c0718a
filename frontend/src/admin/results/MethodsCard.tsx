import { Button, Card, Code, CopyButton, Group, Stack, Text, Title } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { Elsewhere } from "./Elsewhere";
import type { DataOrigin } from "./origins";

interface Props {
  study: string;
  origin: DataOrigin;
  series: number | null;
  every: Schemas["SeriesOut"][];
  choose: (series: number) => void;
}

/** The Methods paragraph, to be copied; each number with the query that gives it. */
export function MethodsCard({ study, origin, series, every, choose }: Props) {
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
            <Elsewhere every={every} shown={data.series} origin={origin} choose={choose} />
            <Text size="sm" c="dimmed">
              What each declared rule left out stands in the methods files of a report.
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
