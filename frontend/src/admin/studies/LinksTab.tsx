import { Anchor, Button, Card, CopyButton, Group, NumberInput, SegmentedControl, Select, Stack, Table, Text, Textarea, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { useChange } from "../ui/useChange";

export function LinksTab() {
  const { study = "" } = useParams({ strict: false });
  const path = { params: { path: { study } } };
  const links = useQuery({
    queryKey: ["links", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/links", path)),
  });
  return (
    <Stack>
      <NewLinks study={study} />
      <Answer of={links}>{(rows) => <LinkTable study={study} rows={rows} />}</Answer>
      <Anchor href={`/api/admin/studies/${study}/links/personal.csv`} download>
        Personal links as CSV
      </Anchor>
    </Stack>
  );
}

function LinkTable({ study, rows }: { study: string; rows: Schemas["LinkOut"][] }) {
  const revoke = useChange(
    (link: string) =>
      unwrap(api.DELETE("/api/admin/studies/{study}/links/{link}", { params: { path: { study, link } } })),
    { touches: [["links", study]], done: "The link is withdrawn." },
  );
  if (rows.length === 0) return <Text c="dimmed">No links yet.</Text>;
  return (
    <Table.ScrollContainer minWidth={640}>
      <Table>
        <Table.Thead>
          <Table.Tr>
            <Table.Th>Link</Table.Th>
            <Table.Th>Kind</Table.Th>
            <Table.Th>For</Table.Th>
            <Table.Th>Runs</Table.Th>
            <Table.Th>Complete</Table.Th>
            <Table.Th>Action</Table.Th>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {rows.map((row) => (
            <Table.Tr key={row.id}>
              <Table.Td>
                <Group gap={6} wrap="nowrap">
                  <CopyButton value={row.url}>
                    {({ copied, copy }) => (
                      <Button size="compact-xs" variant="default" onClick={copy}>
                        {copied ? "Copied" : "Copy"}
                      </Button>
                    )}
                  </CopyButton>
                  <Text size="xs" className="wrap-anywhere">
                    {row.url}
                  </Text>
                </Group>
              </Table.Td>
              <Table.Td>
                {row.kind}
                {row.recruiter !== null && ` (${String(row.recruiter?.["kind"])})`}
              </Table.Td>
              <Table.Td>{row.label}</Table.Td>
              <Table.Td className="number">{row.runs}</Table.Td>
              <Table.Td className="number">
                {row.complete}
                {row.quota === null ? "" : ` of ${row.quota}`}
              </Table.Td>
              <Table.Td>
                <ConfirmButton
                  size="compact-xs"
                  label="Withdraw"
                  question="Nobody can begin by this link any more; those who have begun may finish."
                  confirm="Withdraw"
                  onConfirm={() => revoke.mutate(row.id)}
                />
              </Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}

const RECRUITERS = ["none", "prolific", "sona", "mturk", "generic"] as const;

function NewLinks({ study }: { study: string }) {
  const [kind, setKind] = useState<Schemas["NewLinks"]["kind"]>("general");
  const [label, setLabel] = useState("");
  const [names, setNames] = useState("");
  const [count, setCount] = useState<number | string>(20);
  const [recruiter, setRecruiter] = useState<(typeof RECRUITERS)[number]>("none");
  const [code, setCode] = useState("");
  const make = useChange(
    () => {
      const labels = names.split("\n").map((name) => name.trim()).filter((name) => name !== "");
      const sent =
        recruiter === "none"
          ? null
          : { kind: recruiter, code_complete: code, id_parameter: "", redirect_url: "", code_failed_check: "", code_screened_out: "" };
      const body = { kind, label, labels: kind === "personal" ? labels : [], count: Number(count) || 1, recruiter: sent };
      return unwrap(api.POST("/api/admin/studies/{study}/links", { params: { path: { study } }, body }));
    },
    { touches: [["links", study]], done: "The links are made." },
  );
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        New links
      </Title>
      <Stack>
        <SegmentedControl
          aria-label="Kind of link"
          value={kind}
          onChange={(word) => setKind(word === "personal" || word === "preview" ? word : "general")}
          data={[
            { value: "general", label: "One for everybody" },
            { value: "personal", label: "One a person" },
            { value: "preview", label: "Preview" },
          ]}
        />
        <Group align="end">
          <TextInput label="Label" value={label} onChange={(event) => setLabel(event.currentTarget.value)} />
          {kind === "personal" && <NumberInput label="How many" min={1} max={5000} value={count} onChange={setCount} w={110} />}
          {kind === "general" && (
            <>
              <Select
                label="Recruited through"
                data={[...RECRUITERS]}
                value={recruiter}
                allowDeselect={false}
                onChange={(word) => setRecruiter(RECRUITERS.find((one) => one === word) ?? "none")}
              />
              {recruiter !== "none" && (
                <TextInput label="Completion code" value={code} onChange={(event) => setCode(event.currentTarget.value)} />
              )}
            </>
          )}
          <Button onClick={() => make.mutate(undefined)} loading={make.isPending}>
            Make
          </Button>
        </Group>
        {kind === "personal" && (
          <Textarea
            label="Or one name a line"
            autosize
            minRows={2}
            maxRows={8}
            value={names}
            onChange={(event) => setNames(event.currentTarget.value)}
          />
        )}
      </Stack>
    </Card>
  );
}
