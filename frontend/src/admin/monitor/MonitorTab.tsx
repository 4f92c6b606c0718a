import { Alert, Center, Group, Loader, SegmentedControl, SimpleGrid, Stack, Text } from "@mantine/core";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { ORIGINS } from "../results/origins";
import type { Schemas } from "../api";
import { Figures } from "../ui/Figures";
import { soon } from "../ui/format";
import { onDemand } from "../ui/onDemand";
import { Funnel } from "./Funnel";
import { Groups } from "./Groups";
import { Quality } from "./Quality";
import { RunTable } from "./RunTable";
import { useMonitor } from "./useMonitor";

const FailingClips = onDemand(async () => (await import("./FailingClips")).FailingClips);
type Origin = Schemas["MonitorSnapshot"]["origin"];

const MONITORED = [...ORIGINS, { value: "preview", label: "Preview" }] satisfies { value: Origin; label: string }[];

/** How many runs of other origins there are, in words. */
function othersIn(others: Record<string, number>): string {
  const named = Object.entries(others).map(([origin, runs]) => `${runs} ${origin}`);
  return named.length === 0 ? "" : `Other origins: ${named.join(", ")}`;
}

export function MonitorTab() {
  const { study = "" } = useParams({ strict: false });
  const [chosen, setOrigin] = useState<Origin | null>(null);
  const { snapshot, connected } = useMonitor(study, chosen);
  const interrupted = connected ? null : (
    <Alert color="yellow" role="status">
      The connection is interrupted; trying again.
    </Alert>
  );
  if (snapshot === null)
    return (
      interrupted ?? (
        <Center py="xl">
          <Loader role="status" aria-label="Waiting for the server" />
        </Center>
      )
    );
  return (
    <Stack>
      {interrupted}
      <Group>
        <SegmentedControl aria-label="Runs of" value={chosen ?? snapshot.origin} onChange={(word) => setOrigin(word)} data={MONITORED} />
        <Text size="sm" c="dimmed">
          {othersIn(snapshot.others)}
        </Text>
      </Group>
      <Figures
        figures={[
          ["complete", snapshot.quota === null ? snapshot.complete : `${snapshot.complete} of ${snapshot.quota}`],
          ["under way", snapshot.active],
          ["dropped out", snapshot.dropped],
          ["screened out", snapshot.screened_out],
          ["browsers refused", snapshot.refused_browsers],
          ["expected finish", soon(snapshot.expected_finish, snapshot.server_time)],
        ]}
      />
      {snapshot.runs.length === 0 ? (
        <Text c="dimmed">No run of origin {snapshot.origin} yet. Whoever opens a link appears here within two seconds.</Text>
      ) : (
        <>
          <SimpleGrid cols={{ base: 1, md: 2 }}>
            <Funnel steps={snapshot.funnel} />
            <Quality runs={snapshot.runs} of={snapshot.total} />
            {snapshot.groups.length > 0 && <Groups groups={snapshot.groups} />}
          </SimpleGrid>
          <FailingClips study={study} all />
          <RunTable study={study} snapshot={snapshot} />
        </>
      )}
    </Stack>
  );
}
