import { Stack, Text, Title } from "@mantine/core";
import { useInfiniteQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { DataTable } from "../ui/DataTable";
import { plain, when, words } from "../ui/format";
import { PagedAnswer } from "../ui/Answer";
import { TextWithIds } from "../ui/CopyId";

const A_PAGE = 50;

export function AuditPage() {
  const log = useInfiniteQuery({
    queryKey: ["audit"],
    queryFn: ({ pageParam }) => unwrap(api.GET("/api/admin/audit", { params: { query: { before: pageParam, limit: A_PAGE } } })),
    initialPageParam: null as number | null,
    getNextPageParam: (last) => (last.length === A_PAGE ? (last.at(-1)?.id ?? null) : null),
  });
  const rows = log.data?.pages.flat() ?? [];
  return (
    <Stack>
      <div>
        <Title order={1}>Audit log</Title>
        <Text size="sm" c="dimmed">
          Every change by an account or the command line, latest first.
        </Text>
      </div>
      <PagedAnswer of={log} shown={rows.length} more="Earlier entries">
        <DataTable
          rows={rows}
          rowKey={(row) => row.id}
          empty="No change has been recorded yet."
          paged={false}
          columns={[
            { title: "When", wrap: true, cell: (row) => when(row.at) },
            { title: "Who", cell: (row) => row.actor },
            {
              title: "What",
              wrap: true,
              cell: (row) => <TextWithIds text={`${words(row.action)}: ${words(row.target_kind)} ${row.target}`.trim()} />,
            },
            { title: "Details", wrap: true, wide: true, cell: (row) => <TextWithIds text={detailWords(row.details)} /> },
          ]}
        />
      </PagedAnswer>
    </Stack>
  );
}

/** "version 2, note: shorter text"; what is empty is left out. */
function detailWords(details: Record<string, unknown>): string {
  return Object.entries(details)
    .filter(([, value]) => value !== "" && value !== null)
    .map(([name, value]) => `${words(name)}: ${plain(value)}`)
    .join(", ");
}
