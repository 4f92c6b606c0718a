import { Badge, Button, Card, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { DataTable } from "../ui/DataTable";
import { browserName, when } from "../ui/format";
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
          <DataTable
            rows={rows}
            rowKey={(row) => row.id}
            empty="Nowhere."
            columns={[
              { title: "Browser", cell: (row) => <span title={row.user_agent}>{browserName(row.user_agent)}</span> },
              { title: "Last seen", wide: true, cell: (row) => when(row.last_seen_at) },
              {
                title: "Action",
                cell: (row) =>
                  row.current ? (
                    <Badge variant="default">this one</Badge>
                  ) : (
                    <Button size="xs" variant="default" onClick={() => end.mutate(row.id)}>
                      Sign out
                    </Button>
                  ),
              },
            ]}
          />
        )}
      </Answer>
    </Card>
  );
}
