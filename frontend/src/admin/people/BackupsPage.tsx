/** For owners of the server: how old the newest backup is, and whether one came back. */

import { Alert, Card, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { when } from "../ui/format";

type Backups = Schemas["BackupsOut"];

export function BackupsPage() {
  const backups = useQuery({ queryKey: ["backups"], queryFn: () => unwrap(api.GET("/api/admin/backups")) });
  return (
    <Stack maw={900}>
      <div>
        <Title order={1}>Backups</Title>
        <Text size="sm" c="dimmed">
          Every week the server restores the newest backup to a temporary copy and checks it.
        </Text>
      </div>
      <Answer of={backups}>{(data) => (data.watched ? <Watched backups={data} /> : <Unwatched />)}</Answer>
    </Stack>
  );
}

function Unwatched() {
  return (
    <Alert color="yellow" title="Not watched">
      The server does not know where its backups are. Set PALPEBRA_BACKUP_FOLDER to their folder or bucket and run{" "}
      <code>server backup</code> each day.
    </Alert>
  );
}

function Watched({ backups }: { backups: Backups }) {
  return (
    <>
      <Newest backups={backups} />
      <Drill backups={backups} />
    </>
  );
}

function Newest({ backups }: { backups: Backups }) {
  if (backups.problem !== "") {
    return (
      <Alert color="red" title="The backups cannot be read">
        {backups.problem}
      </Alert>
    );
  }
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Newest backup
      </Title>
      {backups.old && (
        <Alert color="red" mb="sm" title={backups.newest === null ? "No backup" : "It is more than two days old"}>
          Check why none was created: <code>server backup</code> should run each day.
        </Alert>
      )}
      <Text size="sm" className="wrap-anywhere">
        {backups.newest === null || backups.age_hours === null
          ? `None in ${backups.address}.`
          : `${backups.newest}, ${backups.age_hours.toFixed(1)} hours old; ${String(backups.number)} in ${backups.address}.`}
      </Text>
    </Card>
  );
}

function Drill({ backups: { drill, drilled_elsewhere } }: { backups: Backups }) {
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Last restore drill
      </Title>
      {drill === null ? (
        <Text size="sm">
          {drilled_elsewhere
            ? "None here: the backups are encrypted, and the private key is elsewhere. Run server drill --identity on the machine with the key."
            : "None yet."}
        </Text>
      ) : drill.passed ? (
        <Text size="sm" className="wrap-anywhere">
          {drill.backup} came back whole on {when(drill.at)}: {drill.rows ?? 0} rows and {drill.clips ?? 0} clips in{" "}
          {(drill.seconds ?? 0).toFixed(0)} s.
        </Text>
      ) : (
        <Alert color="red" title={`${drill.backup} could not be restored on ${when(drill.at)}`}>
          {drill.said}
        </Alert>
      )}
    </Card>
  );
}
