/** The live monitor: the server sends the whole once, then only the runs that changed. */

import { useQueryClient } from "@tanstack/react-query";
import { startTransition, useEffect, useState } from "react";
import type { Schemas } from "../api";
import { sessionQuery } from "../queries";

type Snapshot = Schemas["MonitorSnapshot"];

const AGAIN_MS = 3_000;

/** `connected` is false while the browser tries to reach the server again. */
export function useMonitor(study: string, origin: Snapshot["origin"] | null): { snapshot: Snapshot | null; connected: boolean } {
  const [snapshot, setSnapshot] = useState<Snapshot | null>(null);
  const [connected, setConnected] = useState(true);
  const queries = useQueryClient();
  useEffect(() => {
    const stop = listen(
      `/api/admin/studies/${encodeURIComponent(study)}/monitor/stream${origin === null ? "" : `?origin=${origin}`}`,
      (fresh, first) => {
        setConnected(true);
        // Many rows may change at once: the browser goes on answering meanwhile.
        startTransition(() => setSnapshot((before) => merge(first ? null : before, fresh)));
      },
      () => {
        setConnected(false);
        // Where it is the session that has ended, this shows the page to sign in.
        void queries.invalidateQueries({ queryKey: sessionQuery.queryKey });
      },
    );
    return stop;
  }, [study, origin, queries]);
  return { snapshot, connected };
}

/**
 * Listen until the returned function is called. A browser comes back by itself where a stream ends, but gives
 * up where it is refused (a proxy's 502 while the server restarts, say): then a new stream is tried.
 */
function listen(address: string, took: (fresh: Snapshot, first: boolean) => void, lost: () => void): () => void {
  let source: EventSource | null = null;
  let again: ReturnType<typeof setTimeout> | undefined;
  const open = () => {
    let first = true;
    source = new EventSource(address);
    source.addEventListener("open", () => {
      first = true;
    });
    source.addEventListener("monitor", (event: MessageEvent<string>) => {
      took(JSON.parse(event.data) as Snapshot, first);
      first = false;
    });
    source.addEventListener("error", () => {
      lost();
      if (source?.readyState === EventSource.CLOSED) again = setTimeout(open, AGAIN_MS);
    });
  };
  open();
  return () => {
    clearTimeout(again);
    source?.close();
  };
}

/** `fresh` with the runs of `before` that it does not mention, in the order they began. */
export function merge(before: Snapshot | null, fresh: Snapshot): Snapshot {
  const runs = new Map((before?.runs ?? []).map((run) => [run.run, run]));
  for (const run of fresh.runs) runs.set(run.run, run);
  return { ...fresh, runs: [...runs.values()] };
}
