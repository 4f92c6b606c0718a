import {
  Anchor,
  Card,
  Code,
  Group,
  Progress,
  Stack,
  Text,
  Title,
  SegmentedControl,
  Alert,
  Center,
  Loader,
  SimpleGrid,
} from "@mantine/core";
import { type Schemas, sessionQuery, studyQuery } from "../api";
import { words, ago, ORIGINS, soon } from "../ui/format";
import { useEffect, useRef, memo, type MouseEvent, useState, startTransition } from "react";
import { Link, useNavigate, useParams } from "@tanstack/react-router";
import { useQueryClient } from "@tanstack/react-query";
import { Figures } from "../studies/Design";
import { onDemand } from "../ui/Answer";

function Funnel({ steps }: { steps: Schemas["FunnelStep"][] }) {
  const all = Math.max(1, steps[0]?.runs ?? 0);
  return (
    <Card withBorder>
      <Stack gap={4}>
        <Title order={2} size="h4">
          Progress
        </Title>
        {steps.map((step) => (
          <Group key={step.stage} gap="sm" wrap="nowrap">
            <Text size="sm" w={100} flex="none">
              {words(step.stage)}
            </Text>
            <Progress value={(100 * step.runs) / all} size="lg" flex={1} aria-label={`${step.runs} reached ${words(step.stage)}`} />
            <Text size="sm" miw={32} ta="end" className="number">
              {step.runs}
            </Text>
          </Group>
        ))}
      </Stack>
    </Card>
  );
}

/** How many are in each group of participants, and how many it takes. */
function Groups({ groups }: { groups: Schemas["GroupCount"][] }) {
  const most = Math.max(1, ...groups.map(({ quota, complete, active }) => quota ?? complete + active));
  return (
    <Card withBorder>
      <Stack gap={4}>
        <Title order={2} size="h4">
          Groups
        </Title>
        {groups.map(({ name, quota, complete, active }) => {
          const of = quota === null ? "no quota" : `of ${quota}`;
          const all = quota ?? most;
          return (
            <Group key={name} gap="sm" wrap="nowrap">
              <Text size="sm" w={100} flex="none">
                {name}
              </Text>
              <Progress.Root size="lg" flex={1}>
                <Progress.Section value={(100 * complete) / all} aria-label={`${complete} complete in ${name}`} />
                <Progress.Section value={(100 * active) / all} color="gray" aria-label={`${active} in progress in ${name}`} />
              </Progress.Root>
              <Text size="sm" miw={150} ta="end" className="number">
                {complete} complete, {active} under way, {of}
              </Text>
            </Group>
          );
        })}
      </Stack>
    </Card>
  );
}

/** What the heat map's letters look like and mean. */
const TRIAL_COLOURS = {
  g: ["#2a9d74", "good"],
  u: ["#6d9dc5", "uncertain"],
  f: ["#e0a100", "flagged"],
  x: ["#d1383d", "failed"],
  ".": ["#8883", "open"],
} as const;

// How the clips were shown so far, over the runs that are listed; at the same time the heat map's legend.

function Quality({ runs, of }: { runs: Schemas["MonitoredRun"][]; of: number }) {
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
  // A share of fewer answers says little.
  const judged = runs.filter((run) => run.answered >= 10);
  const doubtful = judged.filter((run) => run.flagged + run.failed > 0.1 * run.answered);
  return (
    <Card withBorder>
      <Stack gap={6}>
        <Title order={2} size="h4">
          How trials went
        </Title>
        <Text size="sm" c="dimmed">
          All trials, also practice, attention questions and checks, each by its best presentation. Results counts every presentation of
          main trials.
        </Text>
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
        {judged.length > 0 && (
          <Text size="sm" c="dimmed" mt={4}>
            {doubtful.length === 0
              ? "No run with ten or more answers has more than 10% of its clips flagged or failed."
              : `Of runs with ten or more answers, ${doubtful.length} ${doubtful.length === 1 ? "has" : "have"} more than 10% of the clips flagged or failed: ${doubtful
                  .slice(0, 3)
                  .map((run) => run.participant)
                  .join(", ")}${doubtful.length > 3 ? " …" : ""}`}
          </Text>
        )}
        <Text size="sm" c="dimmed">
          Flagged or failed: frames were missing or late, the clip did not fit the window, or the page was left, zoomed or reloaded. Failed
          clips are repeated.
        </Text>
      </Stack>
    </Card>
  );
}

// One run of the heat map: a picture one pixel per trial, stretched by the page.

function HeatRow({ heat, label }: { heat: string; label: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const drawing = canvas.current?.getContext("2d");
    if (drawing == null) return;
    drawing.clearRect(0, 0, heat.length, 1);
    for (let trial = 0; trial < heat.length; trial += 1) {
      drawing.fillStyle = TRIAL_COLOURS[heat[trial] as keyof typeof TRIAL_COLOURS][0];
      drawing.fillRect(trial, 0, 1, 1);
    }
  }, [heat]);
  return <canvas ref={canvas} className="heat" width={heat.length} height={1} role="img" aria-label={label} />;
}

// Participants x trials. Rows that did not change are not drawn again: 500 of them stay smooth.

type Run = Schemas["MonitoredRun"];
const PRESENCES = ["all", "here", "away", "dropped", "finished"];

function RunTable({ study, snapshot }: { study: string; snapshot: Schemas["MonitorSnapshot"] }) {
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
              <th className="only-wide one-line">Main trials</th>
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
      <Text size="sm" c="dimmed">
        Main trials are those that the study counts. Practice trials, attention questions and checks are not counted, but are among the
        squares of “Each trial”. “A person” is the verdict on whether a person took part, from timing, input and checks: likely, unclear or
        unlikely. Open an unclear or unlikely one to see the reasons. Not judged: the run is not over, or its page sent no evidence.
      </Text>
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
      <td className="only-wide one-line">
        {run.evidence_verdict === "unlikely" || run.evidence_verdict === "unclear" ? (
          <a href={`/admin/studies/${study}/participants/${run.run}`} data-run={run.run} aria-label={`${run.evidence_verdict}: why`}>
            {run.evidence_verdict}
          </a>
        ) : run.evidence_verdict ? (
          words(run.evidence_verdict)
        ) : (
          ""
        )}
      </td>
      <td className="number only-wide one-line">
        {run.main_answered} of {run.main_trials}
      </td>
      <td>
        <HeatRow heat={run.heat} label={`${run.answered} answered, ${run.flagged} flagged, ${run.failed} failed`} />
      </td>
    </tr>
  );
});

// The live monitor: the server sends the whole once, then only the runs that changed.

type Snapshot = Schemas["MonitorSnapshot"];

const AGAIN_MS = 3_000;

/** `connected` is false while the browser tries to reach the server again. */
function useMonitor(study: string, origin: Snapshot["origin"] | null): { snapshot: Snapshot | null; connected: boolean } {
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

/** Once more runs are complete, what the study's header says of them is loaded again. */
function useFreshHeader(study: string, snapshot: Snapshot | null): void {
  const queries = useQueryClient();
  const complete = snapshot?.complete;
  useEffect(() => {
    if (complete !== undefined) void queries.invalidateQueries({ queryKey: studyQuery(study).queryKey, exact: true });
  }, [queries, study, complete]);
}

const FailingClips = onDemand(async () => (await import("./FailingClips")).FailingClips);
type Origin = Schemas["MonitorSnapshot"]["origin"];

const MONITORED = [...ORIGINS, { value: "preview", label: "Preview" }] satisfies { value: Origin; label: string }[];

/** How many runs of other origins there are, in words. */
function othersIn(others: Record<string, number>): string {
  const named = Object.entries(others).map(([origin, runs]) => `${runs} ${origin}`);
  return named.length === 0 ? "" : `Other origins: ${named.join(", ")}`;
}

const NO_ONE: Record<string, string> = {
  participant: "No one has started this study yet.",
  pilot: "No one has started the pilot yet.",
  simulated: "There are no simulated participants yet.",
  preview: "No one has previewed this study yet.",
};

/** Nothing to follow yet: why, and what to do. */
function NoOne({ study, origin }: { study: string; origin: string }) {
  const links = (
    <Anchor component={Link} to={`/studies/${study}/links`}>
      link
    </Anchor>
  );
  return (
    <Text c="dimmed">
      {NO_ONE[origin]}{" "}
      {origin === "simulated" ? (
        <>
          Add some with <Code>server simulate {study}</Code>.
        </>
      ) : origin === "preview" ? (
        "Press Preview as a participant to see it as they do."
      ) : (
        <>Share a {links}: people who open it appear here within two seconds.</>
      )}
    </Text>
  );
}

export function MonitorTab() {
  const { study = "" } = useParams({ strict: false });
  const [chosen, setOrigin] = useState<Origin | null>(null);
  const { snapshot, connected } = useMonitor(study, chosen);
  useFreshHeader(study, snapshot);
  const interrupted = connected ? null : (
    <Alert color="yellow" role="status">
      Connection lost; reconnecting.
    </Alert>
  );
  if (snapshot === null)
    return (
      interrupted ?? (
        <Center py="xl">
          <Loader role="status" aria-label="Waiting for the server" />
        </Center>
      )
    );
  return (
    <Stack>
      {interrupted}
      <Group>
        <SegmentedControl aria-label="Runs of" value={chosen ?? snapshot.origin} onChange={(word) => setOrigin(word)} data={MONITORED} />
        <Text size="sm" c="dimmed">
          {othersIn(snapshot.others)}
        </Text>
      </Group>
      <Figures
        figures={[
          ["complete", snapshot.quota === null ? snapshot.complete : `${snapshot.complete} of ${snapshot.quota}`],
          ["under way", snapshot.active],
          ["dropped out", snapshot.dropped],
          ["screened out", snapshot.screened_out],
          ["browsers refused", snapshot.refused_browsers],
          ["expected finish", soon(snapshot.expected_finish, snapshot.server_time)],
        ]}
      />
      {snapshot.runs.length === 0 ? (
        <NoOne study={study} origin={snapshot.origin} />
      ) : (
        <>
          <SimpleGrid cols={{ base: 1, md: 2 }}>
            <Funnel steps={snapshot.funnel} />
            <Quality runs={snapshot.runs} of={snapshot.total} />
            {snapshot.groups.length > 0 && <Groups groups={snapshot.groups} />}
          </SimpleGrid>
          <FailingClips study={study} all />
          <RunTable study={study} snapshot={snapshot} />
        </>
      )}
    </Stack>
  );
}
