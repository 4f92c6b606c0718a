/** What to look at before participants can begin, and what cannot be done any more afterwards. */

import { Alert, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { launchChecksQuery, sealQuery, studyQuery } from "../api";
import { TurnedAway } from "./StatusBadge";

export function BeforeOpening({ study, status }: { study: string; status: string }) {
  const design = useQuery(studyQuery(study)).data?.design;
  const seal = useQuery(sealQuery(study)).data;
  const checks = useQuery(launchChecksQuery(study)).data ?? [];
  const canBeSealed = status === "live" && seal?.sealed_at === null && seal.participants === 0;
  return (
    <>
      {checks.length > 0 && (
        <Stack gap="xs" mt="sm">
          {checks.map(({ kind, blocks, text }) => (
            <Alert
              key={`${kind} ${text}`}
              color={blocks ? "red" : "yellow"}
              title={blocks ? (status === "live" ? "Fix this first" : "Fix this before the study goes live") : "Check this first"}
            >
              <Text size="sm">{text}</Text>
            </Alert>
          ))}
        </Stack>
      )}
      {canBeSealed && (
        <Text size="sm" mt="sm">
          The plan is not sealed. You can seal it only before the first participant, under{" "}
          <Link to="/studies/$study/data" params={{ study }}>
            Data
          </Link>
          .
        </Text>
      )}
      <div style={{ marginBlockStart: "var(--mantine-spacing-sm)" }}>
        <TurnedAway design={design} />
      </div>
    </>
  );
}
