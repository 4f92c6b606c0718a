/** For owners of a study: who else may do what with it, and the workspace it belongs to. */
import { Button, Card, Checkbox, Group, Select, Stack, Text, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap, useOwnWorkspaces } from "../api";
import { Answer } from "../ui/Answer";
import { DataTable } from "../ui/DataTable";
import { useChange } from "../ui/useChange";

type Right = Schemas["GrantOut"]["rights"][number];
const RIGHTS: [Right, string][] = [
  ["view", "look"],
  ["run", "run: links, status, reports"],
  ["edit", "edit and erase"],
  ["export", "download, see single persons"],
  ["own", "own: recruiters’ ids, sharing"],
];

export function Sharing({ summary }: { summary: Schemas["StudySummary"] }) {
  const study = summary.name;
  const grants = useQuery({
    queryKey: ["grants", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/grants", { params: { path: { study } } })),
  });
  const set = useChange(
    ({ account, rights }: { account: string; rights: Right[] }) =>
      unwrap(api.PUT("/api/admin/studies/{study}/grants/{account}", { params: { path: { study, account } }, body: { rights } })),
    { touches: [["grants", study]], done: "Changed." },
  );
  return (
    <Card withBorder>
      <Stack gap="sm">
        <Title order={2} size="h4">
          Sharing
        </Title>
        <Text size="sm">
          The people of the workspace “{summary.workspace}” have the rights of their roles. Give others, or them, more on this study alone:
        </Text>
        <Answer of={grants}>
          {(rows) => (
            <DataTable
              rows={rows}
              rowKey={(row) => row.account}
              empty="No one has separate rights on this study."
              columns={[
                { title: "Account", cell: (row) => row.account },
                { title: "May", wrap: true, cell: (row) => row.rights.join(", ") },
                {
                  title: "Action",
                  cell: (row) => (
                    <Button size="xs" variant="default" onClick={() => set.mutate({ account: row.account, rights: [] })}>
                      Revoke
                    </Button>
                  ),
                },
              ]}
            />
          )}
        </Answer>
        <Grant onGrant={(account, rights) => set.mutate({ account, rights })} />
        <Move summary={summary} />
      </Stack>
    </Card>
  );
}

function Grant({ onGrant }: { onGrant: (account: string, rights: Right[]) => void }) {
  const [account, setAccount] = useState("");
  const [rights, setRights] = useState<Right[]>(["view"]);
  const toggle = (right: Right) => setRights(rights.includes(right) ? rights.filter((one) => one !== right) : [...rights, right]);
  return (
    <Group align="end">
      <TextInput
        label="Account"
        description="its name, exactly"
        value={account}
        onChange={(event) => setAccount(event.currentTarget.value)}
      />
      {RIGHTS.map(([right, label]) => (
        <Checkbox key={right} label={label} checked={rights.includes(right)} onChange={() => toggle(right)} />
      ))}
      <Button variant="default" disabled={account.trim() === "" || rights.length === 0} onClick={() => onGrant(account.trim(), rights)}>
        Grant
      </Button>
    </Group>
  );
}

function Move({ summary }: { summary: Schemas["StudySummary"] }) {
  const others = useOwnWorkspaces().filter(({ name }) => name !== summary.workspace);
  const [chosen, setChosen] = useState<string | null>(null);
  const move = useChange(
    (workspace: string) =>
      unwrap(api.PUT("/api/admin/studies/{study}/workspace", { params: { path: { study: summary.name } }, body: { workspace } })),
    { touches: [["study", summary.name], ["studies"], ["workspaces"]], done: "Study moved." },
  );
  if (others.length === 0) return null;
  return (
    <Group align="end">
      <Select
        label="Move to the workspace"
        data={others.map(({ name, title }) => ({ value: name, label: title }))}
        value={chosen}
        onChange={setChosen}
      />
      <Button variant="default" disabled={chosen === null} onClick={() => chosen !== null && move.mutate(chosen)}>
        Move
      </Button>
    </Group>
  );
}
