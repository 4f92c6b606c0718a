/** The live monitor: the server sends the whole once, then only the runs that changed. */

import { useEffect, useState } from "react";
import type { Schemas } from "../api";

type Snapshot = Schemas["MonitorSnapshot"];

export function useMonitor(study: string): { snapshot: Snapshot | null; connected: boolean } {
  const [snapshot, setSnapshot] = useState<Snapshot | null>(null);
  const [connected, setConnected] = useState(true);
  useEffect(() => {
    const source = new EventSource(`/api/admin/studies/${encodeURIComponent(study)}/monitor/stream`);
    source.addEventListener("open", () => setConnected(true));
    source.addEventListener("error", () => setConnected(false));
    source.addEventListener("monitor", (event: MessageEvent<string>) => {
      const fresh = JSON.parse(event.data) as Snapshot;
      setSnapshot((before) => merge(before, fresh));
    });
    return () => source.close();
  }, [study]);
  return { snapshot, connected };
}

/** `fresh` with the runs of `before` that it does not mention. */
export function merge(before: Snapshot | null, fresh: Snapshot): Snapshot {
  const runs = new Map((before?.runs ?? []).map((run) => [run.run, run]));
  for (const run of fresh.runs) runs.set(run.run, run);
  return { ...fresh, runs: [...runs.values()] };
}
