import { Anchor, Badge, Group, Select, Stack, TextInput } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link, useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { DataTable } from "../ui/DataTable";
import { when } from "../ui/format";

type Run = Schemas["RunSummary"];

export function ParticipantsTab() {
  const { study = "" } = useParams({ strict: false });
  const runs = useQuery({
    queryKey: ["runs", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/runs", { params: { path: { study } } })),
  });
  return <Answer of={runs}>{(rows) => <Runs study={study} rows={rows} />}</Answer>;
}

const SHOW: Record<string, (run: Run) => boolean> = {
  everybody: () => true,
  complete: (run) => run.status === "complete",
  "not complete": (run) => run.status !== "complete",
  excluded: (run) => run.excluded,
  synthetic: (run) => run.synthetic,
};

function Runs({ study, rows }: { study: string; rows: Run[] }) {
  const [sought, setSought] = useState("");
  const [show, setShow] = useState("everybody");
  const chosen = rows.filter(
    (run) => SHOW[show]?.(run) === true && `${run.participant} ${run.run}`.toLowerCase().includes(sought.toLowerCase()),
  );
  return (
    <Stack>
      {rows.length > 0 && (
        <Group align="end">
          <TextInput label="Find" placeholder="participant" value={sought} onChange={(event) => setSought(event.currentTarget.value)} />
          <Select label="Show" data={Object.keys(SHOW)} value={show} allowDeselect={false} onChange={(word) => setShow(word ?? "everybody")} w={160} />
        </Group>
      )}
      <DataTable
        rows={chosen}
        rowKey={(run) => run.run}
        empty={rows.length === 0 ? "Nobody has begun yet." : "Nobody fits."}
        columns={[
          { title: "Participant", wrap: true, cell: (run) => <Who study={study} run={run} /> },
          { title: "Status", cell: (run) => (run.erased_at !== null ? "erased" : run.status.replace("_", " ")) },
          { title: "Answered", number: true, cell: (run) => `${run.answered} of ${run.trials}` },
          { title: "Plays not good", number: true, wide: true, cell: (run) => run.not_good },
          { title: "Began", wide: true, cell: (run) => when(run.started_at) },
          { title: "Minutes", number: true, wide: true, cell: (run) => run.minutes.toFixed(1) },
          { title: "Version", number: true, wide: true, cell: (run) => run.version },
        ]}
      />
    </Stack>
  );
}

function Who({ study, run }: { study: string; run: Run }) {
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
      {run.synthetic && (
        <Badge variant="default" size="sm">
          synthetic
        </Badge>
      )}
    </Group>
  );
}
