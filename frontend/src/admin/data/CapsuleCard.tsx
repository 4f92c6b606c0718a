/** The capsule of a study: made in the background, downloaded, verified by whoever has it. */

import { Badge, Button, Card, Code, Group, Progress, Stack, Switch, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useMay } from "../queries";
import type { DataOrigin } from "../results/origins";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { when } from "../ui/format";
import { useChange } from "../ui/useChange";

const isUnderWay = ({ status }: Schemas["CapsuleOut"]) => status === "queued" || status === "running";

export function CapsuleCard({ study, origin, series }: { study: string; origin: DataOrigin; series: number | null }) {
  const path = { params: { path: { study } } };
  const [clips, setClips] = useState(true);
  const [sensitivity, setSensitivity] = useState(true);
  const mayMake = useMay(study, "run");
  const mayOpen = useMay(study, "export");
  const capsules = useQuery({
    queryKey: ["capsules", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/capsules", path)),
    refetchInterval: ({ state }) => (state.data?.some(isUnderWay) ? 1_000 : false),
  });
  const make = useChange(
    () => unwrap(api.POST("/api/admin/studies/{study}/capsules", { ...path, body: { origin, series, clips, sensitivity } })),
    { touches: [["capsules", study]] },
  );
  const busy = capsules.data?.some(isUnderWay) ?? false;
  return (
    <Card withBorder>
      <Title order={2} size="h4">
        Capsule
      </Title>
      <Text size="sm" mt={4} mb="md" maw={720}>
        Everything that can be handed on, in one zip: de-identified data, clips, definition, sealed plan, report and software versions, as
        Psych-DS and RO-Crate. Whoever has it makes the report again with <Code>analysis verify</Code>. Its report is of one data series:
        the one chosen above, or that of the active version beside the data of every series.
      </Text>
      {mayMake && (
        <Group mb="sm">
          <Switch label="with the clips" checked={clips} onChange={(event) => setClips(event.currentTarget.checked)} />
          <Switch
            label="with mixed and ordinal models"
            checked={sensitivity}
            onChange={(event) => setSensitivity(event.currentTarget.checked)}
          />
          <Button onClick={() => make.mutate(undefined)} loading={make.isPending} disabled={busy}>
            Make a capsule
          </Button>
        </Group>
      )}
      <Answer of={capsules}>
        {(rows) => (
          <Stack gap="xs" role="status" aria-label="Capsules">
            {rows.map((capsule) => (
              <One key={capsule.id} study={study} capsule={capsule} mayOpen={mayOpen} mayRemove={mayMake} />
            ))}
          </Stack>
        )}
      </Answer>
    </Card>
  );
}

interface OneProps {
  study: string;
  capsule: Schemas["CapsuleOut"];
  mayOpen: boolean;
  mayRemove: boolean;
}

function One({ study, capsule, mayOpen, mayRemove }: OneProps) {
  const { id, status, progress, message, bytes, sha256 } = capsule;
  const remove = useChange(
    () => unwrap(api.DELETE("/api/admin/studies/{study}/capsules/{capsule}", { params: { path: { study, capsule: id } } })),
    { touches: [["capsules", study]], done: "The capsule is deleted." },
  );
  return (
    <Group gap="sm">
      <Badge color={status === "failed" ? "red.9" : status === "done" ? "teal.9" : "gray.7"}>{status}</Badge>
      <Text size="sm">
        {when(capsule.created_at)}, {capsule.origin}
        {capsule.series != null && `, series ${capsule.series}`}
        {!capsule.clips && ", without clips"}
      </Text>
      {isUnderWay(capsule) && (
        <>
          <Progress w={160} value={100 * progress} animated aria-label="Progress of the capsule" />
          <Text size="sm">{message}</Text>
        </>
      )}
      {status === "failed" && <Text size="sm">{message}</Text>}
      {bytes != null && mayOpen && (
        <Button component="a" size="compact-sm" variant="default" href={`/api/admin/studies/${study}/capsules/${id}.zip`} download>
          Download ({(bytes / 2 ** 20).toFixed(1)} MiB)
        </Button>
      )}
      {sha256 != null && (
        <Text size="xs" c="dimmed">
          SHA-256 <code>{sha256.slice(0, 12)}</code>
        </Text>
      )}
      {mayRemove && !isUnderWay(capsule) && (
        <ConfirmButton
          size="compact-sm"
          label="Delete"
          question={`The capsule of ${when(capsule.created_at)} is deleted for good. The data stay, and another can be made of them.`}
          confirm="Delete the capsule"
          onConfirm={() => remove.mutate(undefined)}
        />
      )}
    </Group>
  );
}
