/** Participants x trials. Rows that did not change are not drawn again: 500 of them stay smooth. */

import { SegmentedControl, Stack } from "@mantine/core";
import { useNavigate } from "@tanstack/react-router";
import { memo, type MouseEvent, useState } from "react";
import type { Schemas } from "../api";
import { ago, words } from "../ui/format";
import { HeatRow } from "./HeatRow";

type Run = Schemas["MonitoredRun"];
const PRESENCES = ["all", "here", "away", "dropped", "finished"];

export function RunTable({ study, snapshot }: { study: string; snapshot: Schemas["MonitorSnapshot"] }) {
  const [shown, setShown] = useState("all");
  const navigate = useNavigate();
  const follow = (event: MouseEvent) => {
    const run = event.target instanceof Element ? event.target.closest("a")?.dataset["run"] : undefined;
    if (run === undefined || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    void navigate({ to: `/studies/${study}/participants/${run}` });
  };
  const runs = snapshot.runs.filter((run) => shown === "all" || run.presence === shown);
  return (
    <Stack gap="xs">
      <SegmentedControl
        size="xs"
        aria-label="Which runs"
        data={PRESENCES}
        value={shown}
        onChange={setShown}
        style={{ alignSelf: "flex-start" }}
      />
      <div className="scroll-x">
        <table className="runs" onClick={follow}>
          <thead>
            <tr>
              <th>Participant</th>
              <th>Presence</th>
              <th className="only-wide">Stage</th>
              <th className="only-wide one-line">Last seen</th>
              <th className="only-wide one-line">A person</th>
              <th className="only-wide">Trials</th>
              <th className="trials">Each trial</th>
            </tr>
          </thead>
          <tbody>
            {runs.toReversed().map((run) => (
              <Row key={run.run} study={study} run={run} seen={ago(run.last_seen_at, snapshot.server_time)} />
            ))}
          </tbody>
        </table>
      </div>
    </Stack>
  );
}

// Plain cells and a plain link: a row of the library's components takes several times as long, and there are hundreds.
const Row = memo(function Row({ study, run, seen }: { study: string; run: Run; seen: string }) {
  return (
    <tr>
      <td className="wrap-anywhere">
        <a href={`/admin/studies/${study}/participants/${run.run}`} data-run={run.run}>
          {run.participant}
        </a>
        {run.origin !== "participant" && <span className="mark"> {run.origin}</span>}
      </td>
      <td>
        <span className={`mark presence-${run.presence}`}>{run.presence === "finished" ? words(run.status) : run.presence}</span>
      </td>
      <td className="only-wide">{words(run.stage)}</td>
      <td className="only-wide one-line">{seen}</td>
      <td className="only-wide one-line">{run.evidence_verdict ? words(run.evidence_verdict) : ""}</td>
      <td className="number only-wide one-line">
        {run.answered} of {run.trials}
      </td>
      <td>
        <HeatRow heat={run.heat} label={`${run.answered} answered, ${run.flagged} flagged, ${run.failed} failed`} />
      </td>
    </tr>
  );
});
