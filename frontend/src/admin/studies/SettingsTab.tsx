import { Anchor, Button, Card, Group, NumberInput, Select, Stack, Switch, Table, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useNavigate, useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";
import { DefinitionEditor, useCheck } from "./DefinitionEditor";

export function SettingsTab() {
  const { study = "" } = useParams({ strict: false });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {(detail) => (
        <Stack key={detail.summary.revision} maw={900}>
          <Running detail={detail} />
          <ChangeDefinition detail={detail} />
          <Versions detail={detail} />
          {detail.summary.status === "draft" && <Delete name={detail.summary.name} />}
        </Stack>
      )}
    </Answer>
  );
}

type Kind = "prolific" | "sona" | "mturk" | "generic";
const KINDS: Kind[] = ["prolific", "sona", "mturk", "generic"];

function Running({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { name, revision } = detail.summary;
  const before = detail.recruiter ?? {};
  const [paused, setPaused] = useState(detail.summary.paused);
  const [quota, setQuota] = useState<number | string>(detail.summary.quota ?? "");
  const [kind, setKind] = useState(String(before["kind"] ?? ""));
  const [code, setCode] = useState(String(before["code_complete"] ?? ""));
  const [redirect, setRedirect] = useState(String(before["redirect_url"] ?? ""));
  const save = useChange(
    () => {
      const chosen = KINDS.find((one) => one === kind);
      const recruiter = chosen
        ? { kind: chosen, code_complete: code, redirect_url: redirect, id_parameter: "", code_failed_check: "", code_screened_out: "" }
        : null;
      const body = { revision, paused, quota: quota === "" ? null : Number(quota), recruiter };
      return unwrap(api.PUT("/api/admin/studies/{study}/settings", { params: { path: { study: name } }, body }));
    },
    { touches: [["study", name], ["studies"]], done: "Saved." },
  );
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          Running
        </Title>
        <Switch label="Paused: nobody can begin" checked={paused} onChange={(event) => setPaused(event.currentTarget.checked)} />
        <NumberInput label="Close at this many complete runs" placeholder="no limit" min={1} value={quota} onChange={setQuota} maw={280} />
        <Group align="end">
          <Select label="Recruited through" placeholder="nobody" clearable data={KINDS} value={kind === "" ? null : kind} onChange={(word) => setKind(word ?? "")} />
          <TextInput label="Completion code" placeholder="one a run" value={code} onChange={(event) => setCode(event.currentTarget.value)} />
        </Group>
        <TextInput
          label="Address to go to at the end"
          description="{code} and {run} and the parameters of the recruiter's address are filled in."
          value={redirect}
          onChange={(event) => setRedirect(event.currentTarget.value)}
        />
        <Button maw={160} onClick={() => save.mutate(undefined)} loading={save.isPending}>
          Save
        </Button>
      </Stack>
    </Card>
  );
}

function ChangeDefinition({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { name, revision } = detail.summary;
  const [toml, setToml] = useState(detail.toml);
  const [note, setNote] = useState("");
  const usable = useCheck(toml)?.design != null;
  const save = useChange(
    () =>
      unwrap(
        api.POST("/api/admin/studies/{study}/versions", {
          params: { path: { study: name } },
          body: { revision, toml, note },
        }),
      ),
    { touches: [["study", name]], done: "Saved as a new version." },
  );
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          Definition
        </Title>
        <DefinitionEditor toml={toml} onChange={setToml} />
        <Group align="end">
          <TextInput label="What changed" value={note} onChange={(event) => setNote(event.currentTarget.value)} w={320} />
          <Button disabled={toml === detail.toml || !usable} loading={save.isPending} onClick={() => save.mutate(undefined)}>
            Save as a new version
          </Button>
          <Button variant="default" disabled={toml === detail.toml} onClick={() => setToml(detail.toml)}>
            Undo changes
          </Button>
        </Group>
      </Stack>
    </Card>
  );
}

function Versions({ detail }: { detail: Schemas["StudyDetail"] }) {
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Versions
      </Title>
      <Table.ScrollContainer minWidth={520}>
        <Table>
          <Table.Thead>
            <Table.Tr>
              <Table.Th>Version</Table.Th>
              <Table.Th>Made</Table.Th>
              <Table.Th>Runs</Table.Th>
              <Table.Th>Note</Table.Th>
              <Table.Th>SHA-256</Table.Th>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {detail.versions.map((version) => (
              <Table.Tr key={version.number}>
                <Table.Td>
                  <Anchor href={`/api/admin/studies/${detail.summary.name}/versions/${version.number}`} target="_blank" rel="noopener">
                    {version.number}
                  </Anchor>
                </Table.Td>
                <Table.Td>{when(version.created_at)}</Table.Td>
                <Table.Td className="number">{version.runs}</Table.Td>
                <Table.Td>{version.note}</Table.Td>
                <Table.Td>
                  <code>{version.definition_sha256.slice(0, 12)}</code>
                </Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </Table.ScrollContainer>
    </Card>
  );
}

function Delete({ name }: { name: string }) {
  const navigate = useNavigate();
  const remove = useChange(
    () => unwrap(api.DELETE("/api/admin/studies/{study}", { params: { path: { study: name } } })),
    { touches: [["studies"]], done: "The draft is deleted.", then: () => void navigate({ to: "/" }) },
  );
  return (
    <ConfirmButton
      maw={200}
      label="Delete this draft"
      question="The draft and its versions are deleted for good."
      confirm="Delete"
      onConfirm={() => remove.mutate(undefined)}
    />
  );
}
