/** A study copied, put into the archive, taken out, or (a draft that nobody took part in) deleted. */
import { Button, Card, Group, Select, Stack, Text, TextInput, Title } from "@mantine/core";
import { useNavigate } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap, useOwnWorkspaces } from "../api";
import { ConfirmButton } from "../ui/ConfirmButton";
import { useChange } from "../ui/useChange";

export function LifeCycle({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { summary } = detail;
  const mayEdit = summary.rights.includes("edit");
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Copy, archive
      </Title>
      <Stack>
        {mayEdit && <Copy detail={detail} />}
        <Group>
          {summary.archived_at !== null || summary.status === "draft" || summary.status === "closed" ? (
            <Archive summary={summary} />
          ) : (
            <Text size="sm">Close the study before you archive it.</Text>
          )}
          {summary.status === "draft" && mayEdit && <Delete name={summary.name} />}
        </Group>
      </Stack>
    </Card>
  );
}

function Copy({ detail: { summary, versions } }: { detail: Schemas["StudyDetail"] }) {
  const navigate = useNavigate();
  const [name, setName] = useState(`${summary.name.slice(0, 54)}-copy`);
  const [version, setVersion] = useState(String(summary.version));
  const own = useOwnWorkspaces();
  const [chosen, setWorkspace] = useState<string | null>(null);
  const present = own.find((one) => one.name === summary.workspace);
  const workspace = chosen ?? present?.name ?? null;
  const copy = useChange(
    () =>
      unwrap(
        api.POST("/api/admin/studies/{study}/copies", {
          params: { path: { study: summary.name } },
          body: { name, version: Number(version), workspace },
        }),
      ),
    { touches: [["studies"]], done: "Study copied as a draft.", then: (made) => void navigate({ to: `/studies/${made.summary.name}` }) },
  );
  return (
    <>
      <Text size="sm">A copy contains the declaration and the clips, but no answers, links, quota or recruiter.</Text>
      <Group align="end">
        <TextInput label="Short name of the copy" value={name} onChange={(event) => setName(event.currentTarget.value)} />
        <Select
          label="Version to copy"
          data={versions.map((one) => String(one.number))}
          value={version}
          allowDeselect={false}
          onChange={(chosen) => setVersion(chosen ?? version)}
          w={140}
        />
        {own.length > (present === undefined ? 0 : 1) && (
          <Select
            label="Into the workspace"
            data={own.map((one) => ({ value: one.name, label: one.title }))}
            value={workspace}
            allowDeselect={false}
            onChange={setWorkspace}
          />
        )}
        <Button
          variant="default"
          disabled={(workspace === null && own.length > 0) || !/^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$/.test(name)}
          loading={copy.isPending}
          onClick={() => copy.mutate(undefined)}
        >
          Copy
        </Button>
      </Group>
    </>
  );
}

function Archive({ summary }: { summary: Schemas["StudySummary"] }) {
  const archived = summary.archived_at === null;
  const change = useChange(
    () =>
      unwrap(
        api.PUT("/api/admin/studies/{study}/archive", {
          params: { path: { study: summary.name } },
          body: { revision: summary.revision, archived },
        }),
      ),
    { touches: [["study", summary.name], ["studies"]], done: archived ? "Study archived." : "Study restored." },
  );
  return (
    <Button variant="default" loading={change.isPending} onClick={() => change.mutate(undefined)}>
      {archived ? "Archive" : "Restore from archive"}
    </Button>
  );
}

function Delete({ name }: { name: string }) {
  const navigate = useNavigate();
  const remove = useChange(() => unwrap(api.DELETE("/api/admin/studies/{study}", { params: { path: { study: name } } })), {
    touches: [["studies"]],
    done: "Draft deleted.",
    then: () => void navigate({ to: "/" }),
  });
  return (
    <ConfirmButton
      label="Delete this draft"
      question="The draft and its versions are deleted permanently."
      confirm="Delete"
      onConfirm={() => remove.mutate(undefined)}
    />
  );
}
