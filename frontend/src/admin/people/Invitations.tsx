/** One-time links for people who have no account yet: make, see which are open, withdraw. */

import { Alert, Button, Card, Code, CopyButton, Group, Select, Stack, Text, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";
import { workspacesQuery } from "../queries";
import { asRole, type Role, ROLES } from "./roles";

export function Invitations() {
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          Invite somebody
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
          Make a one-time link
        </Button>
      </Group>
      {url !== null && (
        <Alert title="Send this link; it works once, for a week, and is shown only now" color="yellow">
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
    { touches: [["invitations"]], done: "The link is withdrawn." },
  );
  return (
    <Answer of={open}>
      {(rows) =>
        rows.length === 0 ? null : (
          <>
            <Text size="sm" c="dimmed">
              Links that have not been used yet
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
