import { Anchor, Badge, Select, Stack, Switch, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { DataTable } from "../ui/DataTable";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";
import { Invitations } from "./Invitations";
import { asRole, type Role, ROLES } from "./roles";

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
          The role on this server: owners manage accounts and workspaces, experimenters may make workspaces. What somebody may do with
          studies is set under{" "}
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
            empty="Nobody."
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
                    aria-label={`${row.name} may sign in`}
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
