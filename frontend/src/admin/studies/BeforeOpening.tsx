/** What cannot be done any more once participants have begun, and who can be none. */

import { Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { sealQuery, studyQuery } from "../queries";
import { TurnedAway } from "./TurnedAway";

export function BeforeOpening({ study, status }: { study: string; status: string }) {
  const design = useQuery(studyQuery(study)).data?.design;
  const seal = useQuery(sealQuery(study)).data;
  const canBeSealed = status === "live" && seal?.sealed_at === null && seal.participants === 0;
  return (
    <>
      {canBeSealed && (
        <Text size="sm" mt="sm">
          The plan is not sealed: that can only be done before the first participant, under{" "}
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
