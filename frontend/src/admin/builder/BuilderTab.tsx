/** The builder: the declaration by forms, its TOML beneath, saved as a new version. */

import { Button, Group, Stack } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { when } from "../ui/format";
import { onDemand } from "../ui/onDemand";
import { isTable } from "./data";
import { forgetWork, keptWork } from "./kept";

const Workbench = onDemand(async () => (await import("./Workbench")).Workbench);

export function BuilderTab() {
  const { study = "" } = useParams({ strict: false });
  return <Answer of={useQuery(studyQuery(study))}>{(detail) => <Begun key={detail.summary.revision} detail={detail} />}</Answer>;
}

/** Begins with work kept in this browser, where there is some, else with what is stored. */
function Begun({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { name, revision } = detail.summary;
  const [kept] = useState(() => {
    const work = keptWork(name);
    return work !== null && (work.data !== null || work.toml !== detail.toml) ? work : null;
  });
  const [from, setFrom] = useState({ toml: kept?.toml ?? detail.toml, data: kept?.data ?? null });
  const start = useQuery({
    queryKey: ["builder start", from],
    queryFn: () => unwrap(api.POST("/api/admin/definitions/edit", { body: from })),
    staleTime: Infinity,
  });
  const anew = () => {
    forgetWork(name);
    setFrom({ toml: detail.toml, data: null });
  };
  const note =
    kept === null || from.toml !== kept.toml
      ? null
      : `Work of ${when(kept.at)} that was not saved is back.${kept.revision === revision ? "" : " The study was changed since it began; what saving would change is listed below."}`;
  return (
    <Answer of={start}>
      {(read) => (
        <Stack key={read.toml} gap="sm">
          {note !== null && (
            <Group gap="xs" role="status">
              <span>{note}</span>
              <Button size="compact-xs" variant="default" onClick={anew}>
                Discard it
              </Button>
            </Group>
          )}
          <Workbench detail={detail} start={{ toml: read.toml, data: isTable(read.data) ? read.data : {} }} />
        </Stack>
      )}
    </Answer>
  );
}
