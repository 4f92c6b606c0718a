import { Alert, Badge, Card, Group, SimpleGrid, Stack, Table, Text } from "@mantine/core";
import { Link, useParams } from "@tanstack/react-router";
import type { Schemas } from "../api";
import { ago, when } from "../ui/format";
import { Funnel } from "./Funnel";
import { HeatRow } from "./HeatRow";
import { useMonitor } from "./useMonitor";

export function MonitorTab() {
  const { study = "" } = useParams({ strict: false });
  const { snapshot, connected } = useMonitor(study);
  if (snapshot === null) return <Text>Waiting for the server…</Text>;
  const figures: [string, string | number][] = [
    ["complete", snapshot.quota === null ? snapshot.complete : `${snapshot.complete} of ${snapshot.quota}`],
    ["under way", snapshot.active],
    ["dropped out", snapshot.dropped],
    ["browsers refused", snapshot.refused_browsers],
    ["expected finish", when(snapshot.expected_finish)],
  ];
  return (
    <Stack>
      {!connected && <Alert color="yellow">The connection is interrupted; trying again.</Alert>}
      <SimpleGrid cols={{ base: 2, sm: 5 }}>
        {figures.map(([label, value]) => (
          <Card withBorder padding="sm" key={label}>
            <Text fw={600} size="lg" className="number">
              {value}
            </Text>
            <Text size="sm" c="dimmed">
              {label}
            </Text>
          </Card>
        ))}
      </SimpleGrid>
      <Funnel steps={snapshot.funnel} />
      {snapshot.runs.length === 0 ? <Text c="dimmed">Nobody has begun yet.</Text> : <Runs study={study} snapshot={snapshot} />}
    </Stack>
  );
}

const COLOURS = { here: "teal.9", away: "yellow.9", dropped: "red.9", finished: "gray.7" };

function Runs({ study, snapshot }: { study: string; snapshot: Schemas["MonitorSnapshot"] }) {
  return (
    <Table.ScrollContainer minWidth={720}>
      <Table verticalSpacing={4}>
        <Table.Thead>
          <Table.Tr>
            <Table.Th>Participant</Table.Th>
            <Table.Th>Presence</Table.Th>
            <Table.Th>Stage</Table.Th>
            <Table.Th>Last seen</Table.Th>
            <Table.Th>Trials</Table.Th>
            <Table.Th w="38%">
              <Group gap={10} wrap="nowrap">
                Each trial
                <Text span size="xs" c="dimmed">
                  green good, yellow flagged, red failed
                </Text>
              </Group>
            </Table.Th>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {[...snapshot.runs].reverse().map((run) => (
            <Table.Tr key={run.run}>
              <Table.Td>
                <Link to="/studies/$study/participants/$run" params={{ study, run: run.run }}>{run.participant}</Link>
                {run.synthetic && (
                  <Badge ml={6} size="xs" variant="default">
                    synthetic
                  </Badge>
                )}
              </Table.Td>
              <Table.Td>
                <Badge color={COLOURS[run.presence]}>{run.presence}</Badge>
              </Table.Td>
              <Table.Td>{run.stage}</Table.Td>
              <Table.Td>{ago(run.last_seen_at, snapshot.server_time)}</Table.Td>
              <Table.Td className="number">
                {run.answered} of {run.trials}
              </Table.Td>
              <Table.Td>
                <HeatRow heat={run.heat} label={`${run.answered} answered, ${run.flagged} flagged, ${run.failed} failed`} />
              </Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}
