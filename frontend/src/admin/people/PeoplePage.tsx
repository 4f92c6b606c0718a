import { Alert, Button, Card, Code, CopyButton, Group, Select, Stack, Text, TextInput, Title, Anchor, Badge, Switch } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, unwrap, workspacesQuery } from "../api";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { when, asRole, type Role, ROLES } from "../ui/format";
import { useChange } from "../ui/useChange";
import { Link } from "@tanstack/react-router";

// One-time links for people who have no account yet: make, see which are open, withdraw.

function Invitations() {
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          Invite someone
        </Title>
        <Invite />
        <OpenInvitations />
      </Stack>
    </Card>
  );
}

function Invite() {
  const [label, setLabel] = useState("");
  const [role, setRole] = useState<Role>("experimenter");
  const [workspace, setWorkspace] = useState("default");
  const workspaces = useQuery(workspacesQuery).data ?? [];
  const [url, setUrl] = useState<string | null>(null);
  const invite = useChange(() => unwrap(api.POST("/api/admin/invitations", { body: { role, label, workspace } })), {
    touches: [["invitations"]],
    then: (made) => setUrl(made.url),
  });
  return (
    <>
      <Group align="end">
        <TextInput
          label="Whom"
          placeholder="a name, for your list"
          value={label}
          onChange={(event) => setLabel(event.currentTarget.value)}
        />
        <Select label="As" data={ROLES} value={role} allowDeselect={false} onChange={(word) => setRole(asRole(word))} />
        {workspaces.length > 1 && (
          <Select
            label="In the workspace"
            data={workspaces.map(({ name, title }) => ({ value: name, label: title }))}
            value={workspace}
            allowDeselect={false}
            onChange={(name) => setWorkspace(name ?? "default")}
          />
        )}
        <Button onClick={() => invite.mutate(undefined)} loading={invite.isPending}>
          Create one-time link
        </Button>
      </Group>
      {url !== null && (
        <Alert title="Send this link. It works once, for one week, and is shown only now." color="yellow">
          <Code block className="wrap-anywhere" mb="xs">
            {url}
          </Code>
          <CopyButton value={url}>
            {({ copied, copy }) => (
              <Button size="xs" variant="default" onClick={copy}>
                {copied ? "Copied" : "Copy"}
              </Button>
            )}
          </CopyButton>
        </Alert>
      )}
    </>
  );
}

function OpenInvitations() {
  const open = useQuery({ queryKey: ["invitations"], queryFn: () => unwrap(api.GET("/api/admin/invitations")) });
  const withdraw = useChange(
    (invitation_id: number) => unwrap(api.DELETE("/api/admin/invitations/{invitation_id}", { params: { path: { invitation_id } } })),
    { touches: [["invitations"]], done: "Link withdrawn." },
  );
  return (
    <Answer of={open}>
      {(rows) =>
        rows.length === 0 ? null : (
          <>
            <Text size="sm" c="dimmed">
              Unused links
            </Text>
            <DataTable
              rows={rows}
              rowKey={(row) => row.id}
              empty=""
              columns={[
                { title: "For", wrap: true, cell: (row) => row.label || "–" },
                { title: "As", cell: (row) => row.role },
                { title: "Ends", wide: true, cell: (row) => when(row.expires_at) },
                {
                  title: "Action",
                  cell: (row) => (
                    <ConfirmButton
                      size="xs"
                      label="Withdraw"
                      question="The link will no longer work."
                      confirm="Withdraw"
                      onConfirm={() => withdraw.mutate(row.id)}
                    />
                  ),
                },
              ]}
            />
          </>
        )
      }
    </Answer>
  );
}

export function PeoplePage() {
  const accounts = useQuery({ queryKey: ["accounts"], queryFn: () => unwrap(api.GET("/api/admin/accounts")) });
  const change = useChange(
    ({ id, ...body }: { id: number; role?: Role; disabled?: boolean }) =>
      unwrap(api.PATCH("/api/admin/accounts/{account_id}", { params: { path: { account_id: id } }, body })),
    { touches: [["accounts"]], done: "Changed." },
  );
  return (
    <Stack maw={900}>
      <div>
        <Title order={1}>People</Title>
        <Text size="sm" c="dimmed">
          The role on this server: owners manage accounts and workspaces, experimenters can create workspaces. Rights on studies are set
          under{" "}
          <Anchor component={Link} to="/workspaces" underline="always">
            Workspaces
          </Anchor>
          .
        </Text>
      </div>
      <Answer of={accounts}>
        {(rows) => (
          <DataTable
            rows={rows}
            rowKey={(row) => row.id}
            empty="No accounts yet."
            columns={[
              { title: "Name", cell: (row) => row.name },
              {
                title: "Role",
                cell: (row) => (
                  <Select
                    aria-label={`Role of ${row.name}`}
                    data={ROLES}
                    value={row.role}
                    allowDeselect={false}
                    size="xs"
                    w={130}
                    onChange={(role) => change.mutate({ id: row.id, role: asRole(role) })}
                  />
                ),
              },
              {
                title: "Active",
                cell: (row) => (
                  <Switch
                    aria-label={`${row.name} can sign in`}
                    checked={!row.disabled}
                    onChange={(event) => change.mutate({ id: row.id, disabled: !event.currentTarget.checked })}
                  />
                ),
              },
              {
                title: "Second factor",
                wide: true,
                cell: (row) => <Badge color={row.second_factor ? "teal.9" : "gray.7"}>{row.second_factor ? "on" : "off"}</Badge>,
              },
              { title: "Since", wide: true, cell: (row) => when(row.created_at) },
            ]}
          />
        )}
      </Answer>
      <Invitations />
    </Stack>
  );
}
