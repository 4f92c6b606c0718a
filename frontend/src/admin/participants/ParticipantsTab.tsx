import { Anchor, Badge, Table, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link, useParams } from "@tanstack/react-router";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { when } from "../ui/format";

export function ParticipantsTab() {
  const { study = "" } = useParams({ strict: false });
  const runs = useQuery({
    queryKey: ["runs", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/runs", { params: { path: { study } } })),
  });
  return (
    <Answer of={runs}>
      {(rows) =>
        rows.length === 0 ? (
          <Text c="dimmed">Nobody has begun yet.</Text>
        ) : (
          <Table.ScrollContainer minWidth={720}>
            <Table highlightOnHover>
              <Table.Thead>
                <Table.Tr>
                  <Table.Th>Participant</Table.Th>
                  <Table.Th>Status</Table.Th>
                  <Table.Th>Began</Table.Th>
                  <Table.Th>Minutes</Table.Th>
                  <Table.Th>Answered</Table.Th>
                  <Table.Th>Plays not good</Table.Th>
                  <Table.Th>Version</Table.Th>
                </Table.Tr>
              </Table.Thead>
              <Table.Tbody>
                {rows.map((row) => (
                  <Table.Tr key={row.run}>
                    <Table.Td>
                      <Anchor component={Link} to={`/studies/${study}/participants/${row.run}`}>
                        {row.participant}
                      </Anchor>
                    </Table.Td>
                    <Table.Td>
                      {row.erased_at !== null ? "erased" : row.status}{" "}
                      {row.excluded && (
                        <Badge color="red.9" size="sm" title={row.exclusion_reason ?? ""}>
                          excluded
                        </Badge>
                      )}
                      {row.synthetic && (
                        <Badge variant="default" size="sm">
                          synthetic
                        </Badge>
                      )}
                    </Table.Td>
                    <Table.Td>{when(row.started_at)}</Table.Td>
                    <Table.Td className="number">{row.minutes.toFixed(1)}</Table.Td>
                    <Table.Td className="number">
                      {row.answered} of {row.trials}
                    </Table.Td>
                    <Table.Td className="number">{row.not_good}</Table.Td>
                    <Table.Td className="number">{row.version}</Table.Td>
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </Table.ScrollContainer>
        )
      }
    </Answer>
  );
}
