import { Anchor, Badge, Button, Group, Paper, Stack, Table, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import type { Schemas } from "../api";
import { studiesQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { StatusBadge } from "./StatusBadge";

export function StudiesPage() {
  const studies = useQuery(studiesQuery);
  const mayCreate = useMay("experimenter");
  return (
    <Stack>
      <Group justify="space-between">
        <Title order={1}>Studies</Title>
        {mayCreate && (
          <Button component={Link} to="/studies/new">
            New study
          </Button>
        )}
      </Group>
      <Answer of={studies}>{(rows) => (rows.length === 0 ? <Nothing /> : <StudyTable rows={rows} />)}</Answer>
    </Stack>
  );
}

function Nothing() {
  return (
    <Paper withBorder p="xl">
      <Text>
        No studies yet. Start from one of the three that ship with Palpebra, from a definition, or from your own clips.
      </Text>
    </Paper>
  );
}

function StudyTable({ rows }: { rows: Schemas["StudySummary"][] }) {
  return (
    <Table.ScrollContainer minWidth={560}>
      <Table highlightOnHover verticalSpacing="sm">
        <Table.Thead>
          <Table.Tr>
            <Table.Th>Study</Table.Th>
            <Table.Th>Status</Table.Th>
            <Table.Th>Complete</Table.Th>
            <Table.Th>Under way</Table.Th>
            <Table.Th>Version</Table.Th>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {rows.map((row) => (
            <Table.Tr key={row.name}>
              <Table.Td>
                <Anchor component={Link} to={`/studies/${row.name}`}>
                  {row.title}
                </Anchor>
                <Text size="xs" c="dimmed">
                  {row.name}
                </Text>
              </Table.Td>
              <Table.Td>
                <StatusBadge status={row.status} />
                {row.paused && (
                  <Badge ml={6} color="yellow" autoContrast>
                    paused
                  </Badge>
                )}
              </Table.Td>
              <Table.Td className="number">
                {row.complete}
                {row.quota === null ? "" : ` of ${row.quota}`}
              </Table.Td>
              <Table.Td className="number">{row.active}</Table.Td>
              <Table.Td className="number">{row.version}</Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}
