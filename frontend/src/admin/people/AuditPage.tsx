import { Button, Stack, Table, Title } from "@mantine/core";
import { useInfiniteQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { ErrorAlert } from "../ui/Answer";
import { when } from "../ui/format";

export function AuditPage() {
  const log = useInfiniteQuery({
    queryKey: ["audit"],
    queryFn: ({ pageParam }) =>
      unwrap(api.GET("/api/admin/audit", { params: { query: { before: pageParam, limit: 100 } } })),
    initialPageParam: null as number | null,
    getNextPageParam: (last) => (last.length === 100 ? (last.at(-1)?.id ?? null) : null),
  });
  const rows = log.data?.pages.flat() ?? [];
  return (
    <Stack>
      <Title order={1}>Audit log</Title>
      {log.error !== null && <ErrorAlert error={log.error} />}
      <Table.ScrollContainer minWidth={640}>
        <Table>
          <Table.Thead>
            <Table.Tr>
              <Table.Th>When</Table.Th>
              <Table.Th>Who</Table.Th>
              <Table.Th>What</Table.Th>
              <Table.Th>Details</Table.Th>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {rows.map((row) => (
              <Table.Tr key={row.id}>
                <Table.Td>{when(row.at)}</Table.Td>
                <Table.Td>{row.actor}</Table.Td>
                <Table.Td>
                  {row.action} {row.target_kind} {row.target}
                </Table.Td>
                <Table.Td className="wrap-anywhere">
                  {Object.entries(row.details)
                    .map(([name, value]) => `${name}: ${String(value)}`)
                    .join(", ")}
                </Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </Table.ScrollContainer>
      {log.hasNextPage && (
        <Button variant="default" maw={200} onClick={() => void log.fetchNextPage()}>
          Earlier entries
        </Button>
      )}
    </Stack>
  );
}
