import { Anchor, Badge, Button, Group, Paper, Stack, Switch, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import type { Schemas } from "../api";
import { studiesQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { type Column, DataTable } from "../ui/DataTable";
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
      <Answer of={studies}>{(rows) => (rows.length === 0 ? <Nothing /> : <Listed rows={rows} />)}</Answer>
    </Stack>
  );
}

/** The studies, those in the archive where asked for. */
function Listed({ rows }: { rows: Schemas["StudySummary"][] }) {
  const [all, setAll] = useState(false);
  const archived = rows.filter((row) => row.archived_at !== null).length;
  const shown = all ? rows : rows.filter((row) => row.archived_at === null);
  return (
    <>
      {archived > 0 && (
        <Switch checked={all} onChange={(event) => setAll(event.currentTarget.checked)} label={`Also those in the archive (${archived})`} />
      )}
      <DataTable rows={shown} rowKey={(row) => row.name} columns={COLUMNS} empty="No studies but those in the archive." />
    </>
  );
}

function Nothing() {
  return (
    <Paper withBorder p="xl">
      <Text>No studies yet. Start from one of the three that ship with Palpebra, from a definition, or from your own clips.</Text>
    </Paper>
  );
}

const COLUMNS: Column<Schemas["StudySummary"]>[] = [
  {
    title: "Study",
    wrap: true,
    cell: (row) => (
      <>
        <Anchor component={Link} to={`/studies/${row.name}`}>
          {row.title}
        </Anchor>
        <Text size="xs" c="dimmed">
          {row.name}
        </Text>
      </>
    ),
  },
  {
    title: "Status",
    cell: (row) => (
      <>
        <StatusBadge status={row.status} />
        {row.paused && (
          <Badge ml={6} color="yellow" autoContrast>
            paused
          </Badge>
        )}
        {row.archived_at !== null && (
          <Badge ml={6} variant="default">
            archived
          </Badge>
        )}
      </>
    ),
  },
  { title: "Complete", number: true, cell: (row) => `${row.complete}${row.quota === null ? "" : ` of ${row.quota}`}` },
  { title: "Under way", number: true, wide: true, cell: (row) => row.active },
  { title: "Version", number: true, wide: true, cell: (row) => row.version },
];
