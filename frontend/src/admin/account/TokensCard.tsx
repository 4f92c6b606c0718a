import { Alert, Button, Card, Checkbox, Code, Group, Stack, Text, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";

type Scope = Schemas["NewToken"]["scopes"][number];
const SCOPES: Scope[] = ["read", "personal", "write", "export"];

export function TokensCard() {
  const tokens = useQuery({ queryKey: ["tokens"], queryFn: () => unwrap(api.GET("/api/admin/tokens")) });
  const [name, setName] = useState("");
  const [scopes, setScopes] = useState<string[]>(["read"]);
  const [fresh, setFresh] = useState<string | null>(null);
  const create = useChange(
    () => unwrap(api.POST("/api/admin/tokens", { body: { name, scopes: SCOPES.filter((scope) => scopes.includes(scope)), days: 365 } })),
    { touches: [["tokens"]], then: ({ token }) => setFresh(token) },
  );
  const revoke = useChange((token_id: number) => unwrap(api.DELETE("/api/admin/tokens/{token_id}", { params: { path: { token_id } } })), {
    touches: [["tokens"]],
    done: "The token is revoked.",
  });
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          API tokens
        </Title>
        <Text size="sm">For scripts: send it as “Authorization: Bearer …”. A token can do no more than you.</Text>
        {fresh !== null && (
          <Alert title="Your new token, shown only now" color="yellow">
            <Code block className="wrap-anywhere">
              {fresh}
            </Code>
          </Alert>
        )}
        <Group align="end">
          <TextInput label="Name" value={name} onChange={(event) => setName(event.currentTarget.value)} />
          <Checkbox.Group value={scopes} onChange={setScopes} label="May">
            <Group mt={6}>
              {SCOPES.map((scope) => (
                <Checkbox key={scope} value={scope} label={scope} />
              ))}
            </Group>
          </Checkbox.Group>
          <Button disabled={name === "" || scopes.length === 0} onClick={() => create.mutate(undefined)}>
            Make a token
          </Button>
        </Group>
        <Answer of={tokens}>
          {(rows) => (
            <DataTable
              rows={rows}
              rowKey={(row) => row.id}
              empty="No tokens."
              columns={[
                { title: "Name", cell: (row) => row.name },
                { title: "May", cell: (row) => row.scopes.join(", ") },
                { title: "Last used", wide: true, cell: (row) => when(row.last_used_at) },
                { title: "Ends", wide: true, cell: (row) => when(row.expires_at) },
                {
                  title: "Action",
                  cell: (row) => (
                    <ConfirmButton
                      size="xs"
                      label="Revoke"
                      question={`Scripts that use “${row.name}” will stop working.`}
                      confirm="Revoke"
                      onConfirm={() => revoke.mutate(row.id)}
                    />
                  ),
                },
              ]}
            />
          )}
        </Answer>
      </Stack>
    </Card>
  );
}
