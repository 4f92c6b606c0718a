import { Alert, Center, Loader, SimpleGrid, Stack, Text } from "@mantine/core";
import { useParams } from "@tanstack/react-router";
import { Figures } from "../ui/Figures";
import { soon } from "../ui/format";
import { Funnel } from "./Funnel";
import { Quality } from "./Quality";
import { RunTable } from "./RunTable";
import { useMonitor } from "./useMonitor";

export function MonitorTab() {
  const { study = "" } = useParams({ strict: false });
  const { snapshot, connected } = useMonitor(study);
  const interrupted = connected ? null : (
    <Alert color="yellow" role="status">
      The connection is interrupted; trying again.
    </Alert>
  );
  if (snapshot === null)
    return (
      interrupted ?? (
        <Center py="xl">
          <Loader aria-label="Waiting for the server" />
        </Center>
      )
    );
  return (
    <Stack>
      {interrupted}
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
        <Text c="dimmed">Nobody has begun yet. Whoever opens a link appears here within two seconds.</Text>
      ) : (
        <>
          <SimpleGrid cols={{ base: 1, md: 2 }}>
            <Funnel steps={snapshot.funnel} />
            <Quality runs={snapshot.runs} of={snapshot.total} />
          </SimpleGrid>
          <RunTable study={study} snapshot={snapshot} />
        </>
      )}
    </Stack>
  );
}
