import { Alert, Anchor, Badge, Button, Group, Paper, Stack, Switch, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { type Schemas, sessionQuery, studiesQuery, useOwnWorkspaces } from "../api";
import { Answer } from "../ui/Answer";
import { type Column, DataTable } from "../ui/DataTable";
import { StatusBadge } from "./StatusBadge";

export function StudiesPage() {
  const studies = useQuery(studiesQuery);
  const mayCreate = useOwnWorkspaces().length > 0;
  const mine = useQuery(sessionQuery).data?.workspaces ?? [];
  const closed = mine.filter((workspace) => workspace.second_factor_needed);
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
      {closed.map(({ name, title }) => (
        <Alert key={name} color="yellow" title={`The studies of “${title}” are closed to you`}>
          It requires a second factor. Set one up under{" "}
          <Anchor component={Link} to="/account" underline="always">
            My account
          </Anchor>
          , or sign in again with it.
        </Alert>
      ))}
      <Answer of={studies}>
        {(rows) =>
          rows.length === 0 ? (
            <Nothing mayCreate={mayCreate} />
          ) : (
            <Listed rows={rows} columns={mine.length > 1 ? WITH_WORKSPACE : COLUMNS} />
          )
        }
      </Answer>
    </Stack>
  );
}

/** The studies, those in the archive where asked for. */
function Listed({ rows, columns }: { rows: Schemas["StudySummary"][]; columns: typeof COLUMNS }) {
  const [all, setAll] = useState(false);
  const archived = rows.filter((row) => row.archived_at !== null).length;
  const shown = all ? rows : rows.filter((row) => row.archived_at === null);
  return (
    <>
      {archived > 0 && (
        <Switch checked={all} onChange={(event) => setAll(event.currentTarget.checked)} label={`Include archived studies (${archived})`} />
      )}
      <DataTable rows={shown} rowKey={(row) => row.name} columns={columns} empty="All studies are archived." />
    </>
  );
}

function Nothing({ mayCreate }: { mayCreate: boolean }) {
  return (
    <Paper withBorder p="xl">
      <Text>
        {mayCreate
          ? "No studies yet. Start with one of the three that ship with Palpebra, a definition, or your own clips."
          : "You have no access to any study yet. Ask an owner of your workspace."}
      </Text>
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
const WITH_WORKSPACE: typeof COLUMNS = [
  ...COLUMNS.slice(0, 1),
  { title: "Workspace", wide: true, cell: (row) => row.workspace },
  ...COLUMNS.slice(1),
];
