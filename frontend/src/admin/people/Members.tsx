/** The people of one workspace: take in, change the role, take out. */

import { Badge, Button, Group, Select, TextInput } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { useChange } from "../ui/useChange";
import { asRole, type Role, ROLES } from "./roles";

export function Members({ workspace }: { workspace: string }) {
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
    { touches, done: "Taken out." },
  );
  return (
    <>
      <Answer of={members}>
        {(rows) => (
          <DataTable
            rows={rows}
            rowKey={(row) => row.account}
            empty="Nobody yet."
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
                    label="Take out"
                    question={`${row.account} will no longer see the studies of this workspace; rights on single studies stay.`}
                    confirm="Take out"
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
        label="Take in the account"
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
        Take in
      </Button>
    </Group>
  );
}
