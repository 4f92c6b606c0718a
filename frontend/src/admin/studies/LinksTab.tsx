import { Button, CopyButton, Group, Stack, Text } from "@mantine/core";
import { useInfiniteQuery, useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { api, type Schemas, unwrap, studyQuery } from "../api";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { onDemand, PagedAnswer } from "../ui/Answer";
import { useChange } from "../ui/useChange";
import { addressFor, SigningButton } from "./recruiting";
import { TurnedAway } from "./StatusBadge";

const NewLinks = onDemand(async () => (await import("./NewLinks")).NewLinks);

export function LinksTab() {
  const { study = "" } = useParams({ strict: false });
  const links = useInfiniteQuery({
    queryKey: ["links", study],
    queryFn: ({ pageParam }) =>
      unwrap(api.GET("/api/admin/studies/{study}/links", { params: { path: { study }, query: { after: pageParam } } })),
    initialPageParam: null as string | null,
    getNextPageParam: (last) => last.next,
  });
  const detail = useQuery(studyQuery(study)).data;
  const rows = links.data?.pages.flatMap((page) => page.links) ?? [];
  return (
    <Stack>
      <TurnedAway study={study} design={detail?.design} />
      <NewLinks study={study} />
      <PagedAnswer of={links} shown={rows.length} total={links.data?.pages.at(-1)?.total} more="More links">
        <LinkTable study={study} rows={rows} recruiter={detail?.recruiter ?? null} owns={detail?.summary.rights.includes("own") ?? false} />
      </PagedAnswer>
      <Button
        component="a"
        variant="default"
        style={{ alignSelf: "flex-start" }}
        href={`/api/admin/studies/${study}/links/personal.csv`}
        download
      >
        Personal links as CSV
      </Button>
    </Stack>
  );
}

interface TableProps {
  study: string;
  rows: Schemas["LinkOut"][];
  recruiter: Record<string, unknown> | null;
  owns: boolean;
}

function LinkTable({ study, rows, recruiter, owns }: TableProps) {
  const revoke = useChange(
    (link: string) => unwrap(api.DELETE("/api/admin/studies/{study}/links/{link}", { params: { path: { study, link } } })),
    { touches: [["links", study]], done: "Link withdrawn." },
  );
  return (
    <DataTable
      rows={rows}
      rowKey={(row) => row.id}
      empty="No links yet. Create one above."
      paged={false}
      columns={[
        {
          title: "Link",
          cell: (row) => <Address url={row.kind === "general" ? addressFor(row.url, row.recruiter ?? recruiter) : row.url} />,
        },
        { title: "For", wrap: true, cell: (row) => row.label || "–" },
        ...(rows.some((row) => row.group_name !== "")
          ? [{ title: "Group", cell: (row: Schemas["LinkOut"]) => row.group_name || "–" }]
          : []),
        { title: "Kind", wide: true, cell: (row) => `${row.kind}${row.recruiter === null ? "" : ` (${String(row.recruiter["kind"])})`}` },
        { title: "Runs", number: true, cell: (row) => row.runs },
        { title: "Complete", number: true, wide: true, cell: (row) => `${row.complete}${row.quota === null ? "" : ` of ${row.quota}`}` },
        {
          title: "Action",
          cell: (row) => (
            <Group gap={6} wrap="nowrap">
              {owns && Boolean(row.recruiter?.["signature_parameter"]) && <SigningButton study={study} link={row.id} />}
              <ConfirmButton
                size="compact-xs"
                label="Withdraw"
                question="This link no longer starts new runs. Runs in progress can finish."
                confirm="Withdraw"
                onConfirm={() => revoke.mutate(row.id)}
              />
            </Group>
          ),
        },
      ]}
    />
  );
}

function Address({ url }: { url: string }) {
  return (
    <Group gap={6} wrap="nowrap">
      <CopyButton value={url}>
        {({ copied, copy }) => (
          <Button size="compact-xs" variant="default" onClick={copy} flex="none">
            {copied ? "Copied" : "Copy"}
          </Button>
        )}
      </CopyButton>
      <Text size="xs" visibleFrom="sm">
        {url}
      </Text>
    </Group>
  );
}
