/** The dress rehearsal: simulated people in a sandbox, and what they would leave behind. */

import { Alert, Button, Card, Group, NumberInput, Progress, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { counted, when } from "../ui/format";
import { useChange } from "../ui/useChange";
import { Columns, Order, PowerOfPlan, Report, Summary } from "./Shown";

type Rehearsal = Schemas["RehearsalOut"];

const MAX_PEOPLE = 60;
const isUnderWay = ({ status }: Rehearsal): boolean => status === "queued" || status === "running";

export function RehearsalTab() {
  const { study = "" } = useParams({ strict: false });
  const path = { params: { path: { study } } };
  const mayBegin = useMay(study, "run");
  const [participants, setParticipants] = useState(8);
  const latest = useQuery({
    queryKey: ["rehearsal", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/rehearsals/latest", path)),
    refetchInterval: ({ state }) => (state.data && isUnderWay(state.data) ? 1_000 : false),
  });
  const begin = useChange(() => unwrap(api.POST("/api/admin/studies/{study}/rehearsals", { ...path, body: { participants, seed: 1 } })), {
    touches: [["rehearsal", study]],
  });
  const busy = latest.data ? isUnderWay(latest.data) : false;
  return (
    <Stack>
      <Card withBorder>
        <Title order={2} size="h4">
          Dress rehearsal
        </Title>
        <Text size="sm" mt={4} mb="md" maw={720}>
          Simulated people go through the whole study in a database of its own, which is thrown away: in which order they see what, how long
          it takes, the columns that you will get, the report that they would give, and the power of the plan. Nothing of it meets the data
          of people. Their answers say nothing about people.
        </Text>
        {mayBegin && (
          <Group align="end">
            <NumberInput
              label="Simulated people"
              min={1}
              max={MAX_PEOPLE}
              w={150}
              value={participants}
              onChange={(value) => setParticipants(Math.min(MAX_PEOPLE, Math.max(1, Math.round(Number(value) || 1))))}
            />
            <Button onClick={() => begin.mutate(undefined)} loading={begin.isPending} disabled={busy}>
              Rehearse
            </Button>
          </Group>
        )}
      </Card>
      <Answer of={latest}>
        {(data) => (data === null ? <Text c="dimmed">Not rehearsed yet.</Text> : <Latest study={study} rehearsal={data} />)}
      </Answer>
    </Stack>
  );
}

const WORDS: Record<Rehearsal["status"], string> = {
  queued: "Rehearsing",
  running: "Rehearsing",
  done: "Rehearsed",
  failed: "Failed",
  cancelled: "Cancelled",
};

function Latest({ study, rehearsal }: { study: string; rehearsal: Rehearsal }) {
  const { id, status, progress, message } = rehearsal;
  const mayEnd = useMay(study, "run");
  const path = { params: { path: { study, rehearsal: id } } };
  const cancel = useChange(() => unwrap(api.POST("/api/admin/studies/{study}/rehearsals/{rehearsal}/cancel", path)), {
    touches: [["rehearsal", study]],
  });
  return (
    <Stack>
      <Group gap="sm" role="status" aria-label="Rehearsal">
        <Text size="sm">
          {WORDS[status]}, version {rehearsal.version} with {counted(rehearsal.participants, "participant")}, {when(rehearsal.created_at)}
        </Text>
        {isUnderWay(rehearsal) && (
          <>
            <Progress w={200} value={100 * progress} animated aria-label="Progress of the rehearsal" />
            <Text size="sm">{message}</Text>
            {mayEnd && (
              <Button size="compact-sm" variant="default" loading={cancel.isPending} onClick={() => cancel.mutate(undefined)}>
                Cancel
              </Button>
            )}
          </>
        )}
      </Group>
      {status === "failed" && (
        <Alert color="red" variant="light" title="The rehearsal stopped" role="alert">
          {message}
        </Alert>
      )}
      {status === "done" && <Shown study={study} rehearsal={rehearsal.id} />}
    </Stack>
  );
}

function Shown({ study, rehearsal }: { study: string; rehearsal: string }) {
  const result = useQuery({
    queryKey: ["rehearsal shown", study, rehearsal],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/rehearsals/{rehearsal}", { params: { path: { study, rehearsal } } })),
    staleTime: Infinity,
  });
  return (
    <Answer of={result}>
      {(data) => (
        <Stack>
          <Summary result={data} />
          <Report result={data} address={`/api/admin/studies/${study}/rehearsals/${rehearsal}/report/`} />
          <PowerOfPlan result={data} />
          <Order result={data} />
          <Columns result={data} />
        </Stack>
      )}
    </Answer>
  );
}
