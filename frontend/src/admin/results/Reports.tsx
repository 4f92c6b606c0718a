import { Anchor, Badge, Button, Card, Group, Progress, Stack, Switch, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";
import type { DataOrigin } from "./origins";

export function Reports({ study, origin, series }: { study: string; origin: DataOrigin; series: number | null }) {
  const path = { params: { path: { study } } };
  const [sensitivity, setSensitivity] = useState(true);
  const mayBuild = useMay(study, "run");
  const mayOpen = useMay(study, "export");
  const reports = useQuery({
    queryKey: ["reports", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/reports", path)),
    refetchInterval: (query) => (query.state.data?.some(isUnderWay) ? 1_000 : false),
  });
  const build = useChange(
    () => unwrap(api.POST("/api/admin/studies/{study}/reports", { ...path, body: { origin, series, sensitivity } })),
    { touches: [["reports", study]] },
  );
  return (
    <Card withBorder>
      <Group justify="space-between" mb="sm" gap="sm">
        <Title order={2} size="h4">
          Analysis reports
        </Title>
        {mayBuild && (
          <Group>
            <Switch
              label="with mixed and ordinal models"
              checked={sensitivity}
              onChange={(event) => setSensitivity(event.currentTarget.checked)}
            />
            <Button onClick={() => build.mutate(undefined)} loading={build.isPending}>
              Build a report
            </Button>
          </Group>
        )}
      </Group>
      <Answer of={reports}>
        {(rows) =>
          rows.length === 0 ? (
            <Text c="dimmed">None yet. A report holds the tables, figures and the analysis of variance of this study.</Text>
          ) : (
            <Stack gap="xs">
              {rows.map((row) => (
                <Report key={row.id} study={study} report={row} mayOpen={mayOpen} />
              ))}
            </Stack>
          )
        }
      </Answer>
    </Card>
  );
}

function isUnderWay(report: Schemas["ReportOut"]): boolean {
  return report.status === "queued" || report.status === "running";
}

function Report({ study, report, mayOpen }: { study: string; report: Schemas["ReportOut"]; mayOpen: boolean }) {
  const address = (file: string) => `/api/admin/studies/${study}/reports/${report.id}/${file}`;
  return (
    <Group gap="sm">
      <Badge color={report.status === "failed" ? "red.9" : report.status === "done" ? "teal.9" : "gray.7"}>{report.status}</Badge>
      <Text size="sm">
        {when(report.created_at)}, {report.origin}
        {report.series != null && `, series ${report.series}`}
      </Text>
      {isUnderWay(report) && <Progress w={160} value={100 * report.progress} animated aria-label={report.message} />}
      {report.status === "failed" && <Text size="sm">{report.message}</Text>}
      {mayOpen &&
        report.files.map((file) => (
          <Anchor key={file} href={address(file)} target="_blank" rel="noopener" size="sm">
            {file}
          </Anchor>
        ))}
      {!mayOpen && report.files.length > 0 && <Text size="sm">Its files hold rows of single persons: they need the right “export”.</Text>}
    </Group>
  );
}
