import { Anchor, Card, Stack, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import type { Schemas } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { DataTable } from "../ui/DataTable";
import { when } from "../ui/format";
import { onDemand } from "../ui/onDemand";
import { PageLanguages } from "./PageLanguages";
import { RetentionCard } from "./RetentionCard";
import { Running } from "./Running";

const CompareVersions = onDemand(async () => (await import("./CompareVersions")).CompareVersions);
const LifeCycle = onDemand(async () => (await import("./LifeCycle")).LifeCycle);
const Sharing = onDemand(async () => (await import("./Sharing")).Sharing);

export function SettingsTab() {
  const { study = "" } = useParams({ strict: false });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {(detail) => (
        <Stack key={detail.summary.revision} maw={900}>
          <Running detail={detail} />
          <Versions detail={detail} />
          <CompareVersions detail={detail} />
          <RetentionCard study={detail.summary.name} />
          <PageLanguages />
          {detail.summary.rights.includes("own") && <Sharing summary={detail.summary} />}
          <LifeCycle detail={detail} />
        </Stack>
      )}
    </Answer>
  );
}

type Version = Schemas["StudyDetail"]["versions"][number];

function Versions({ detail }: { detail: Schemas["StudyDetail"] }) {
  const address = (version: Version) => `/api/admin/studies/${detail.summary.name}/versions/${version.number}`;
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Versions
      </Title>
      <DataTable
        rows={detail.versions}
        rowKey={(version) => version.number}
        empty="None."
        columns={[
          {
            title: "Version",
            number: true,
            cell: (version) => (
              <Anchor href={address(version)} target="_blank" rel="noopener">
                {version.number}
              </Anchor>
            ),
          },
          { title: "Made", cell: (version) => when(version.created_at) },
          { title: "Runs", number: true, cell: (version) => version.runs },
          { title: "Note", wrap: true, cell: (version) => version.note },
          { title: "SHA-256", wide: true, cell: (version) => <code>{version.definition_sha256.slice(0, 12)}</code> },
        ]}
      />
    </Card>
  );
}
