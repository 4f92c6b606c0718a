import { Alert, Anchor, Badge, Button, Group, Paper, Stack, Text, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { type Schemas, sessionQuery, studiesQuery, useOwnWorkspaces } from "../api";
import { Answer } from "../ui/Answer";
import { type Column, DataTable } from "../ui/DataTable";
import { ago, counted } from "../ui/format";
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
        <Alert key={name} color="yellow" title={`The studies of “${title}” cannot be opened yet`}>
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
            <StudyGroups rows={rows} columns={mine.length > 1 ? WITH_WORKSPACE : COLUMNS} />
          )
        }
      </Answer>
    </Stack>
  );
}

type Listed = Schemas["ListedStudy"];

const GROUPS = [
  ["live", "Live"],
  ["pilot", "Pilot"],
  ["draft", "Drafts"],
  ["closed", "Closed"],
  ["archived", "Archive"],
] as const;
const groupOf = (row: Listed) => (row.archived_at === null ? row.status : "archived");

/** Those whose title, name, owner or workspace has every word that is searched for. */
export function matching<Row extends Pick<Listed, "title" | "name" | "owner" | "workspace">>(rows: readonly Row[], search: string): Row[] {
  const parts = search.toLowerCase().split(/\s+/);
  return rows.filter((row) => {
    const text = [row.title, row.name, row.owner, row.workspace].join(" ").toLowerCase();
    return parts.every((part) => text.includes(part));
  });
}

const SEARCHED_FROM = 6;

/** The studies by status; the archive is folded. */
function StudyGroups({ rows, columns }: { rows: Listed[]; columns: typeof COLUMNS }) {
  const [search, setSearch] = useState("");
  const shown = matching(rows, search);
  return (
    <>
      {rows.length >= SEARCHED_FROM && (
        <TextInput
          type="search"
          aria-label="Search studies"
          placeholder="Search by title, name, owner or workspace"
          value={search}
          onChange={(event) => setSearch(event.currentTarget.value)}
          maw={420}
        />
      )}
      <Text size="sm" role="status" hidden={search === ""}>
        {counted(shown.length, "study", "studies")} found.
      </Text>
      {GROUPS.map(([group, label]) => {
        const members = shown.filter((row) => groupOf(row) === group);
        if (members.length === 0) return null;
        const table = <DataTable rows={members} rowKey={(row) => row.name} columns={columns} empty="" label={`Studies: ${label}`} />;
        return group === "archived" ? (
          <details key={group}>
            <summary>
              {label} ({members.length})
            </summary>
            {table}
          </details>
        ) : (
          <section key={group} aria-label={label}>
            <Title order={2} size="h4">
              {label}
            </Title>
            {table}
          </section>
        );
      })}
    </>
  );
}

/** Before the first study: what belongs here, and the first step. */
function Nothing({ mayCreate }: { mayCreate: boolean }) {
  return (
    <Paper withBorder p="xl">
      <Stack align="flex-start">
        <Text>
          {mayCreate
            ? "Your studies appear here. Start with your own clips, with a study that ships with Palpebra, or with a definition."
            : "You have no access to any study yet. Ask an owner of your workspace."}
        </Text>
        {mayCreate && (
          <Button component={Link} to="/studies/new">
            Create the first study
          </Button>
        )}
      </Stack>
    </Paper>
  );
}

/** A bar a day, today at the right; the numbers are in its name. */
function Days({ counts }: { counts: readonly number[] }) {
  const most = Math.max(1, ...counts);
  const total = counts.reduce((sum, count) => sum + count, 0);
  const label = `${counted(total, "complete run")} in ${String(counts.length)} days; today ${String(counts.at(-1) ?? 0)}, at most ${String(most)} a day`;
  if (total === 0)
    return (
      <Text span c="dimmed" size="sm">
        –
      </Text>
    );
  return (
    <svg width={counts.length * 6} height={22} role="img" aria-label={label}>
      <title>{label}</title>
      {counts.map((count, day) => {
        const height = count === 0 ? 1 : Math.max(3, (20 * count) / most);
        return <rect key={day} x={day * 6} y={21 - height} width={4} height={height} fill="currentColor" opacity={count === 0 ? 0.3 : 1} />;
      })}
    </svg>
  );
}

const COLUMNS: Column<Listed>[] = [
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
  { title: "Complete per day", wide: true, cell: (row) => <Days counts={row.completed_by_day} /> },
  { title: "Last activity", wide: true, cell: (row) => ago(row.last_activity, new Date().toISOString()) },
  { title: "Owner", wide: true, cell: (row) => row.owner || "–" },
];
const WITH_WORKSPACE: typeof COLUMNS = [
  ...COLUMNS.slice(0, 1),
  { title: "Workspace", wide: true, cell: (row) => row.workspace },
  ...COLUMNS.slice(1),
];
