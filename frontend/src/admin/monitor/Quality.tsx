/** How the clips were shown so far, over the runs that are listed; at the same time the heat map's legend. */

import { Card, Group, Stack, Text, Title } from "@mantine/core";
import type { Schemas } from "../api";
import { TRIAL_COLOURS } from "./colours";

export function Quality({ runs, of }: { runs: Schemas["MonitoredRun"][]; of: number }) {
  const total = (count: (run: Schemas["MonitoredRun"]) => number) => runs.reduce((sum, run) => sum + count(run), 0);
  const flagged = total((run) => run.flagged);
  const uncertain = total((run) => run.uncertain);
  const failed = total((run) => run.failed);
  const answered = total((run) => run.answered);
  const counts = {
    g: answered - uncertain - flagged - failed,
    u: uncertain,
    f: flagged,
    x: failed,
    // What was left in runs that are over will not come.
    ".": total((run) => (run.status === "active" && run.presence !== "dropped" ? run.trials - run.answered : 0)),
  };
  const doubtful = runs.filter((run) => run.answered >= 10 && run.flagged + run.failed > 0.1 * run.answered);
  return (
    <Card withBorder>
      <Stack gap={6}>
        <Title order={2} size="h4">
          How trials went
        </Title>
        {of > runs.length && (
          <Text size="sm" c="dimmed">
            Of the latest {runs.length.toLocaleString()} runs; all {of.toLocaleString()} are under Participants and Results.
          </Text>
        )}
        {(Object.keys(counts) as (keyof typeof counts)[]).map((letter) => (
          <Group key={letter} gap="sm">
            <svg width={14} height={14} aria-hidden="true">
              <rect width={14} height={14} rx={2} fill={TRIAL_COLOURS[letter][0]} />
            </svg>
            <Text size="sm" w={70}>
              {TRIAL_COLOURS[letter][1]}
            </Text>
            <Text size="sm" className="number">
              {counts[letter].toLocaleString()}
            </Text>
          </Group>
        ))}
        <Text size="sm" c="dimmed" mt={4}>
          {doubtful.length === 0
            ? "No run has more than a tenth of its clips flagged or failed."
            : `${doubtful.length} ${doubtful.length === 1 ? "run has" : "runs have"} more than a tenth of the clips flagged or failed: ${doubtful
                .slice(0, 3)
                .map((run) => run.participant)
                .join(", ")}${doubtful.length > 3 ? " …" : ""}`}
        </Text>
        <Text size="sm" c="dimmed">
          Flagged or failed: pictures of the clip were left out or came late, or the page was left, zoomed or loaded anew meanwhile. A
          failed clip is shown again.
        </Text>
      </Stack>
    </Card>
  );
}
