import { Anchor, Badge, Group, Select, Stack, Switch, TextInput } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { keepPreviousData, useInfiniteQuery, useQuery } from "@tanstack/react-query";
import { Link, useParams } from "@tanstack/react-router";
import { useState } from "react";
import type { paths } from "../../api/schema";
import { api, type Schemas, unwrap, studyQuery } from "../api";
import { DataTable } from "../ui/DataTable";
import { when } from "../ui/format";
import { PagedAnswer } from "../ui/Answer";

type Run = Schemas["RunSummary"];
type Asked = NonNullable<paths["/api/admin/studies/{study}/runs"]["get"]["parameters"]["query"]>;
type Show = NonNullable<Asked["show"]>;

const SHOW: { value: Show; label: string }[] = [
  { value: "everybody", label: "everybody" },
  { value: "complete", label: "complete" },
  { value: "not_complete", label: "not complete" },
  { value: "excluded", label: "excluded" },
  { value: "pilot", label: "pilot" },
];
/** So long after the last key the server is asked. */
const TYPING_MS = 250;

export function ParticipantsTab() {
  const { study = "" } = useParams({ strict: false });
  const [search, setSearch] = useState("");
  const [show, setShow] = useState<Show>("everybody");
  const [sought] = useDebouncedValue(search.trim(), TYPING_MS);
  const [simulated, setSimulated] = useState(false);
  const chosen = sought !== "" || show !== "everybody" || simulated;
  const runs = useInfiniteQuery({
    queryKey: ["runs", study, show, simulated, sought],
    queryFn: ({ pageParam }) =>
      unwrap(
        api.GET("/api/admin/studies/{study}/runs", {
          params: { path: { study }, query: { show, simulated, search: sought, before: pageParam } },
        }),
      ),
    initialPageParam: null as string | null,
    getNextPageParam: (last) => last.next,
    placeholderData: keepPreviousData,
  });
  // Where nobody but simulated people took part, the switch is what shows them.
  const hasSimulated = useQuery(studyQuery(study)).data?.series.some(({ runs: by }) => (by["simulated"] ?? 0) > 0) ?? false;
  const rows = runs.data?.pages.flatMap((page) => page.runs) ?? [];
  const total = runs.data?.pages.at(-1)?.total ?? 0;
  return (
    <Stack>
      {(rows.length > 0 || chosen || hasSimulated) && (
        <Group align="end">
          <TextInput label="Find" placeholder="participant" value={search} onChange={(event) => setSearch(event.currentTarget.value)} />
          <Select
            label="Show"
            data={SHOW}
            value={show}
            allowDeselect={false}
            onChange={(word) => setShow(SHOW.find(({ value }) => value === word)?.value ?? "everybody")}
            w={160}
          />
          <Switch
            label="Include simulated participants"
            checked={simulated}
            onChange={(event) => setSimulated(event.currentTarget.checked)}
            mb={8}
          />
        </Group>
      )}
      <PagedAnswer of={runs} shown={rows.length} total={total} more="Earlier participants">
        <RunsTable
          study={study}
          rows={rows}
          empty={
            chosen
              ? "No participant matches. Change the text or the choice above."
              : "No one has started yet. Share a link from the tab Links."
          }
        />
      </PagedAnswer>
    </Stack>
  );
}

function RunsTable({ study, rows, empty }: { study: string; rows: Run[]; empty: string }) {
  return (
    <DataTable
      rows={rows}
      rowKey={(run) => run.run}
      empty={empty}
      paged={false}
      columns={[
        { title: "Participant", wrap: true, cell: (run) => <ParticipantCell study={study} run={run} /> },
        { title: "Status", cell: (run) => (run.erased_at !== null ? "erased" : run.status.replace("_", " ")) },
        { title: "Answered", number: true, cell: (run) => `${run.main_answered} of ${run.main_trials}` },
        { title: "Plays flagged or failed", number: true, wide: true, cell: (run) => run.not_good },
        { title: "Began", wide: true, cell: (run) => when(run.started_at) },
        { title: "Minutes", number: true, wide: true, cell: (run) => run.minutes.toFixed(1) },
        { title: "Version", number: true, wide: true, cell: (run) => run.version },
      ]}
    />
  );
}

function ParticipantCell({ study, run }: { study: string; run: Run }) {
  return (
    <Group gap={6}>
      <Anchor component={Link} to={`/studies/${study}/participants/${run.run}`}>
        {run.participant}
      </Anchor>
      {run.excluded && (
        <Badge color="red.9" size="sm" title={run.exclusion_reason ?? ""}>
          excluded
        </Badge>
      )}
      {run.refused > 0 && (
        <Badge color="orange.9" size="sm" title="Answers or views that could not be stored. Open the participant to see why.">
          {run.refused} not stored
        </Badge>
      )}
      {run.origin !== "participant" && (
        <Badge variant="default" size="sm">
          {run.origin}
        </Badge>
      )}
    </Group>
  );
}
