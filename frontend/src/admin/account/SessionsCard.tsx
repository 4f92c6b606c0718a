import { Badge, Button, Card, Table, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";

export function SessionsCard() {
  const sessions = useQuery({ queryKey: ["sessions"], queryFn: () => unwrap(api.GET("/api/admin/sessions")) });
  const end = useChange(
    (session_id: number) => unwrap(api.DELETE("/api/admin/sessions/{session_id}", { params: { path: { session_id } } })),
    { touches: [["sessions"]], done: "That browser is signed out." },
  );
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Where you are signed in
      </Title>
      <Answer of={sessions}>
        {(rows) => (
          <Table.ScrollContainer minWidth={520}>
            <Table>
              <Table.Thead>
                <Table.Tr>
                  <Table.Th>Browser</Table.Th>
                  <Table.Th>Last seen</Table.Th>
                  <Table.Th>Action</Table.Th>
                </Table.Tr>
              </Table.Thead>
              <Table.Tbody>
                {rows.map((row) => (
                  <Table.Tr key={row.id}>
                    <Table.Td className="wrap-anywhere">{row.user_agent.slice(0, 80) || "unknown"}</Table.Td>
                    <Table.Td>{when(row.last_seen_at)}</Table.Td>
                    <Table.Td>
                      {row.current ? (
                        <Badge variant="light">this one</Badge>
                      ) : (
                        <Button size="xs" variant="default" onClick={() => end.mutate(row.id)}>
                          Sign out
                        </Button>
                      )}
                    </Table.Td>
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </Table.ScrollContainer>
        )}
      </Answer>
    </Card>
  );
}
