/** By which other services the own account is signed in to. Shown only where this server knows any. */

import { Card, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { Answer } from "../ui/Answer";
import { AddLogin } from "./AddLogin";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";
import { Refusal, waysQuery } from "./ProviderButtons";

export function LoginsCard() {
  const ways = useQuery(waysQuery);
  const logins = useQuery({ queryKey: ["logins"], queryFn: () => unwrap(api.GET("/api/admin/logins")) });
  const remove = useChange((login_id: number) => unwrap(api.DELETE("/api/admin/logins/{login_id}", { params: { path: { login_id } } })), {
    touches: [["logins"]],
    done: "The login is removed.",
  });
  const providers = ways.data?.providers ?? [];
  if (providers.length === 0) return null;
  const labels = new Map(providers.map(({ id, label }) => [id, label]));
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          Other ways to sign in
        </Title>
        <Refusal />
        <Answer of={logins}>
          {(rows) => (
            <DataTable
              rows={rows}
              rowKey={(row) => row.id}
              empty="None but name and password."
              columns={[
                { title: "Service", cell: (row) => labels.get(row.provider) ?? row.issuer },
                { title: "As", cell: (row) => row.label },
                { title: "Last used", wide: true, cell: (row) => when(row.last_used_at) },
                {
                  title: "Action",
                  cell: (row) => (
                    <ConfirmButton
                      size="xs"
                      label="Remove"
                      question={`“${row.label}” will not sign in to this account any more.`}
                      confirm="Remove"
                      onConfirm={() => remove.mutate(row.id)}
                    />
                  ),
                },
              ]}
            />
          )}
        </Answer>
        <Group>
          {providers.map((provider) => (
            <AddLogin key={provider.id} {...provider} />
          ))}
        </Group>
        <Text size="sm" c="dimmed">
          You go to the service, say who you are there, and come back.
        </Text>
      </Stack>
    </Card>
  );
}
