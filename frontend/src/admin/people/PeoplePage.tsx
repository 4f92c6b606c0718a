import { Alert, Badge, Button, Card, Code, Group, Select, Stack, Switch, Table, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";

type Role = Schemas["AccountOut"]["role"];
const ROLES: Role[] = ["viewer", "experimenter", "owner"];

function asRole(word: string | null): Role {
  return ROLES.find((role) => role === word) ?? "viewer";
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
      <Title order={1}>People</Title>
      <Invite />
      <Answer of={accounts}>
        {(rows) => (
          <Table.ScrollContainer minWidth={560}>
            <Table>
              <Table.Thead>
                <Table.Tr>
                  <Table.Th>Name</Table.Th>
                  <Table.Th>Role</Table.Th>
                  <Table.Th>Second factor</Table.Th>
                  <Table.Th>Since</Table.Th>
                  <Table.Th>Active</Table.Th>
                </Table.Tr>
              </Table.Thead>
              <Table.Tbody>
                {rows.map((row) => (
                  <Table.Tr key={row.id}>
                    <Table.Td>{row.name}</Table.Td>
                    <Table.Td>
                      <Select
                        aria-label={`Role of ${row.name}`}
                        data={ROLES}
                        value={row.role}
                        allowDeselect={false}
                        size="xs"
                        onChange={(role) => change.mutate({ id: row.id, role: asRole(role) })}
                      />
                    </Table.Td>
                    <Table.Td>
                      <Badge color={row.second_factor ? "teal" : "gray"} variant="light" autoContrast>
                        {row.second_factor ? "on" : "off"}
                      </Badge>
                    </Table.Td>
                    <Table.Td>{when(row.created_at)}</Table.Td>
                    <Table.Td>
                      <Switch
                        aria-label={`${row.name} may sign in`}
                        checked={!row.disabled}
                        onChange={(event) => change.mutate({ id: row.id, disabled: !event.currentTarget.checked })}
                      />
                    </Table.Td>
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </Table.ScrollContainer>
        )}
      </Answer>
    </Stack>
  );
}

function Invite() {
  const [label, setLabel] = useState("");
  const [role, setRole] = useState<Role>("experimenter");
  const [url, setUrl] = useState<string | null>(null);
  const invite = useChange(() => unwrap(api.POST("/api/admin/invitations", { body: { role, label } })), {
    touches: [["invitations"]],
    then: (made) => setUrl(made.url),
  });
  return (
    <Card withBorder>
      <Group align="end">
        <TextInput label="Whom to invite" value={label} onChange={(event) => setLabel(event.currentTarget.value)} />
        <Select
          label="As"
          data={ROLES}
          value={role}
          allowDeselect={false}
          onChange={(word) => setRole(asRole(word))}
        />
        <Button onClick={() => invite.mutate(undefined)} loading={invite.isPending}>
          Make a one-time link
        </Button>
      </Group>
      {url !== null && (
        <Alert title="Send this link; it works once, for a week" color="yellow" mt="md">
          <Code block className="wrap-anywhere">
            {url}
          </Code>
        </Alert>
      )}
    </Card>
  );
}
