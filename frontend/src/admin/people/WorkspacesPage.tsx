/** Laboratories that share this server: who belongs to which, as what. */

import { Badge, Button, Group, Select, TextInput, Alert, Card, Stack, Switch, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, unwrap, type Schemas, sessionQuery, workspacesQuery } from "../api";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { useChange } from "../ui/useChange";
import { asRole, type Role, ROLES } from "../ui/format";

// The people of one workspace: take in, change the role, take out.

function Members({ workspace }: { workspace: string }) {
  const touches = [["members", workspace], ["workspaces"], ["session"], ["studies"]];
  const members = useQuery({
    queryKey: ["members", workspace],
    queryFn: () => unwrap(api.GET("/api/admin/workspaces/{workspace}/members", { params: { path: { workspace } } })),
  });
  const set = useChange(
    ({ account, role }: { account: string; role: Role }) =>
      unwrap(api.PUT("/api/admin/workspaces/{workspace}/members/{account}", { params: { path: { workspace, account } }, body: { role } })),
    { touches, done: "Changed." },
  );
  const remove = useChange(
    (account: string) =>
      unwrap(api.DELETE("/api/admin/workspaces/{workspace}/members/{account}", { params: { path: { workspace, account } } })),
    { touches, done: "Member removed." },
  );
  return (
    <>
      <Answer of={members}>
        {(rows) => (
          <DataTable
            rows={rows}
            rowKey={(row) => row.account}
            empty="No members yet."
            columns={[
              { title: "Name", cell: (row) => row.account },
              {
                title: "Role here",
                cell: (row) => (
                  <Select
                    aria-label={`Role of ${row.account} in ${workspace}`}
                    data={ROLES}
                    value={row.role}
                    allowDeselect={false}
                    size="xs"
                    w={130}
                    onChange={(role) => set.mutate({ account: row.account, role: asRole(role) })}
                  />
                ),
              },
              {
                title: "Second factor",
                wide: true,
                cell: (row) => <Badge color={row.second_factor ? "teal.9" : "gray.7"}>{row.second_factor ? "on" : "off"}</Badge>,
              },
              {
                title: "Action",
                cell: (row) => (
                  <ConfirmButton
                    size="xs"
                    label="Remove"
                    question={`${row.account} will no longer see the studies of this workspace. Rights on single studies stay.`}
                    confirm="Remove"
                    onConfirm={() => remove.mutate(row.account)}
                  />
                ),
              },
            ]}
          />
        )}
      </Answer>
      <TakeIn workspace={workspace} onAdd={(account, role) => set.mutate({ account, role })} />
    </>
  );
}

function TakeIn({ workspace, onAdd }: { workspace: string; onAdd: (account: string, role: Role) => void }) {
  const [account, setAccount] = useState("");
  const [role, setRole] = useState<Role>("experimenter");
  return (
    <Group align="end">
      <TextInput
        label="Add member"
        description="its name, exactly"
        value={account}
        onChange={(event) => setAccount(event.currentTarget.value)}
      />
      <Select
        aria-label={`Role of the new member of ${workspace}`}
        data={ROLES}
        value={role}
        allowDeselect={false}
        w={140}
        onChange={(word) => setRole(asRole(word))}
      />
      <Button
        variant="default"
        disabled={account.trim() === ""}
        onClick={() => {
          onAdd(account.trim(), role);
          setAccount("");
        }}
      >
        Add
      </Button>
    </Group>
  );
}

type Workspace = Schemas["WorkspaceOut"];
const TOUCHED = [["workspaces"], ["session"], ["studies"]];

export function WorkspacesPage() {
  const account = useQuery(sessionQuery).data?.account;
  const manages = account?.role === "owner";
  return (
    <Stack maw={900}>
      <div>
        <Title order={1}>Workspaces</Title>
        <Text size="sm" c="dimmed">
          A study belongs to a workspace and is visible to its members only. Viewers see and download, experimenters create and run studies,
          owners see recruiter IDs and manage members. To share a single study, use its settings.
        </Text>
      </div>
      <Answer of={useQuery(workspacesQuery)}>
        {(rows) => (
          <>
            {rows.length === 0 && <Alert color="yellow">You are not a member of any workspace yet. Ask an owner to add you.</Alert>}
            {rows.map((row) => (
              <OneWorkspace key={row.name} workspace={row} manages={manages} />
            ))}
          </>
        )}
      </Answer>
      {account !== undefined && account?.role !== "viewer" && <NewWorkspace />}
    </Stack>
  );
}

function OneWorkspace({ workspace, manages }: { workspace: Workspace; manages: boolean }) {
  const mine = manages || workspace.role === "owner";
  return (
    <Card withBorder component="section" aria-label={workspace.title}>
      <Stack gap="sm">
        <Group justify="space-between">
          <Title order={2} size="h4">
            {workspace.title}
          </Title>
          <Group gap="xs">
            {workspace.second_factor_required && <Badge color="teal.9">second factor</Badge>}
            <Badge color="gray.7">{workspace.role ?? "not a member"}</Badge>
          </Group>
        </Group>
        <Text size="sm" c="dimmed">
          {workspace.name}, {workspace.members} {workspace.members === 1 ? "person" : "people"}, {workspace.studies}{" "}
          {workspace.studies === 1 ? "study" : "studies"}
        </Text>
        {mine && <Settings workspace={workspace} mayDelete={manages} />}
        {mine && <Members workspace={workspace.name} />}
      </Stack>
    </Card>
  );
}

function Settings({ workspace, mayDelete }: { workspace: Workspace; mayDelete: boolean }) {
  const path = { params: { path: { workspace: workspace.name } } };
  const [title, setTitle] = useState(workspace.title);
  const change = useChange((body: Schemas["ChangeWorkspace"]) => unwrap(api.PUT("/api/admin/workspaces/{workspace}", { ...path, body })), {
    touches: TOUCHED,
    done: "Changed.",
  });
  const remove = useChange(() => unwrap(api.DELETE("/api/admin/workspaces/{workspace}", path)), {
    touches: TOUCHED,
    done: "Workspace deleted.",
  });
  const { second_factor_required } = workspace;
  return (
    <Group align="end">
      <TextInput label="Title" value={title} maxLength={200} onChange={(event) => setTitle(event.currentTarget.value)} />
      <Button
        variant="default"
        disabled={title.trim() === "" || title === workspace.title}
        onClick={() => change.mutate({ title, second_factor_required })}
      >
        Save
      </Button>
      <Switch
        label="Require a second factor"
        checked={second_factor_required}
        onChange={(event) => change.mutate({ title: workspace.title, second_factor_required: event.currentTarget.checked })}
      />
      {mayDelete && workspace.studies === 0 && workspace.name !== "default" && (
        <ConfirmButton
          label="Delete"
          question="The workspace is deleted; the accounts stay."
          confirm="Delete"
          onConfirm={() => remove.mutate(undefined)}
        />
      )}
    </Group>
  );
}

function NewWorkspace() {
  const [title, setTitle] = useState("");
  const name = title
    .toLowerCase()
    .normalize("NFKD")
    .replace(/[^a-z0-9]+/g, "-")
    .replace(/^-+|-+$/g, "")
    .slice(0, 60);
  const create = useChange(() => unwrap(api.POST("/api/admin/workspaces", { body: { name, title } })), {
    touches: TOUCHED,
    done: "Workspace created; you are its owner.",
    then: () => setTitle(""),
  });
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        New workspace
      </Title>
      <Group align="end">
        <TextInput
          label="Its title"
          placeholder="Perception laboratory"
          value={title}
          maxLength={200}
          onChange={(event) => setTitle(event.currentTarget.value)}
        />
        <Button disabled={name === ""} loading={create.isPending} onClick={() => create.mutate(undefined)}>
          Create
        </Button>
      </Group>
    </Card>
  );
}
