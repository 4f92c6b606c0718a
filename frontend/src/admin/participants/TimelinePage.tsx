import { Button, Modal, Stack, Text, Group, TextInput, Anchor, Badge, Card, Title } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, unwrap, type Schemas, useMay } from "../api";
import { Answer } from "../ui/Answer";
import { CopyId, TextWithIds } from "../ui/CopyId";
import { plain, fixed, ruleWords, VERDICT_COLOURS, when, words } from "../ui/format";
import { useState } from "react";
import { useChange } from "../ui/useChange";
import { answerWords } from "../replay/shown";
import { Link, useParams } from "@tanstack/react-router";
import { type Column, DataTable } from "../ui/DataTable";

interface IdentityProps {
  study: string;
  run: string;
}

/** For owners: who the participant is to the recruiter, asked for only when it is opened. */
function IdentityButton({ study, run }: IdentityProps) {
  const [opened, { open, close }] = useDisclosure(false);
  return (
    <>
      <Button variant="default" onClick={open}>
        Show identity
      </Button>
      <Modal opened={opened} onClose={close} title="Identity" closeButtonProps={{ "aria-label": "Close" }}>
        {opened && <Identity study={study} run={run} />}
      </Modal>
    </>
  );
}

function Identity({ study, run }: IdentityProps) {
  const identity = useQuery({
    queryKey: ["identity", study, run],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/runs/{run}/identity", { params: { path: { study, run } } })),
    gcTime: 0,
    staleTime: Infinity,
  });
  return (
    <Answer of={identity}>
      {(data) => (
        <Stack gap="xs">
          <Text>Recruiter’s ID: {data.identifier || "none"}</Text>
          <Text>Link: {data.link || "without a label"}</Text>
          {Object.entries(data.parameters).map(([name, value]) => (
            <Text size="sm" key={name} className="wrap-anywhere">
              {name}: {plain(value)}
            </Text>
          ))}
          <Text size="sm" c="dimmed">
            This access is recorded in the audit log.
          </Text>
        </Stack>
      )}
    </Answer>
  );
}

interface ActionsProps {
  study: string;
  summary: Schemas["RunSummary"];
  mayErase: boolean;
}

function RunActions({ study, summary, mayErase }: ActionsProps) {
  const path = { params: { path: { study, run: summary.run } } };
  const touches = [
    ["timeline", study, summary.run],
    ["runs", study],
    ["results", study],
  ];
  const include = useChange(() => unwrap(api.DELETE("/api/admin/studies/{study}/runs/{run}/exclusion", path)), {
    touches,
    done: "Run included again.",
  });
  const exclude = useChange(
    (reason: string) => unwrap(api.PUT("/api/admin/studies/{study}/runs/{run}/exclusion", { ...path, body: { reason } })),
    { touches, done: "Run excluded." },
  );
  const erase = useChange(
    (confirm: string) => unwrap(api.POST("/api/admin/studies/{study}/runs/{run}/erase", { ...path, body: { confirm } })),
    {
      touches,
      done: "The person's data were erased in all of their known visits. Existing reports still contain them: build the reports again.",
    },
  );
  return (
    <Group>
      {summary.excluded ? (
        <Button variant="default" onClick={() => include.mutate(undefined)}>
          Undo the exclusion
        </Button>
      ) : (
        <Ask
          label="Exclude"
          words="The data stay, marked as excluded with your reason. You can undo this."
          field="Reason"
          ready={(text) => text.trim().length >= 3}
          onDone={(reason) => exclude.mutate(reason)}
        />
      )}
      {mayErase && (
        <Ask
          label="Erase this person's data"
          words={`Ratings, questionnaires and events of this person are deleted permanently. To continue, type ${summary.run}.`}
          field="Identifier of the run"
          ready={(text) => text === summary.run}
          onDone={(confirm) => erase.mutate(confirm)}
        />
      )}
    </Group>
  );
}

interface AskProps {
  label: string;
  words: string;
  field: string;
  ready: (text: string) => boolean;
  onDone: (text: string) => void;
}

function Ask({ label, words, field, ready, onDone }: AskProps) {
  const [opened, { open, close }] = useDisclosure(false);
  const [text, setText] = useState("");
  return (
    <>
      <Button variant="default" onClick={open}>
        {label}
      </Button>
      <Modal opened={opened} onClose={close} title={label} closeButtonProps={{ "aria-label": "Close" }}>
        <Text mb="md" component="div">
          <TextWithIds text={words} />
        </Text>
        <TextInput label={field} value={text} onChange={(event) => setText(event.currentTarget.value)} data-autofocus />
        <Group justify="flex-end" mt="md">
          <Button variant="default" onClick={close}>
            Cancel
          </Button>
          <Button
            color="red"
            disabled={!ready(text)}
            onClick={() => {
              close();
              onDone(text);
            }}
          >
            {label}
          </Button>
        </Group>
      </Modal>
    </>
  );
}

// Every play of a run: what was shown, frame by frame, and what was answered.

type Trial = Schemas["TimelineTrial"];

const COLUMNS: Column<Trial>[] = [
  {
    title: "Trial",
    number: true,
    cell: (trial) => (
      <>
        <ReplayLink trial={trial.trial_index} />
        {trial.play > 1 && ` (play ${trial.play})`}{" "}
        {trial.kind !== "main" && (
          <Badge variant="default" size="sm">
            {trial.kind}
          </Badge>
        )}
      </>
    ),
  },
  { title: "Clip", wrap: true, cell: clipsOf },
  {
    title: "Answer",
    number: true,
    cell: (trial) => `${given(trial)}${trial.expected_response === null ? "" : ` (asked for ${trial.expected_response})`}`,
  },
  { title: "After", number: true, wide: true, cell: (trial) => (trial.rt === null ? "–" : `${fixed(trial.rt, 0)} ms`) },
  {
    title: "Shown",
    cell: (trial) => (
      <Badge color={VERDICT_COLOURS[trial.verdict] ?? "gray.7"} size="sm" title={ruleWords(trial.verdict_rule)}>
        {trial.verdict}
      </Badge>
    ),
  },
  {
    title: "Frames",
    number: true,
    wide: true,
    cell: (trial) => (trial.frames_drawn === null ? "–" : `${trial.frames_drawn}, ${trial.frames_missing ?? 0} missing`),
  },
  { title: "Each frame drawn", wide: true, cell: (trial) => (trial.drawn === null ? "–" : <Ticks drawn={trial.drawn} />) },
];

/** The trial's number, which leads to its replay. */
function ReplayLink({ trial }: { trial: number }) {
  const { study = "", run = "" } = useParams({ strict: false });
  return (
    <Anchor
      component={Link}
      to={`/studies/${study}/participants/${run}/replay`}
      search={{ trial } as never}
      title={`Replay trial ${trial}`}
    >
      {trial}
    </Anchor>
  );
}

/** Each clip of the trial; of several with its role. */
function clipsOf({ clips }: Trial): string {
  const named = clips.map(({ role, cell, exemplar }) => `${clips.length > 1 ? `${role} ` : ""}${cell} ${exemplar}`);
  return named.join(", ") || "–";
}

/** The one number, or what was answered in words. */
const given = ({ response, answer }: Trial): string => (response === null ? answerWords({ answer }) : String(response));

function TrialTable({ trials }: { trials: Trial[] }) {
  return (
    <DataTable
      dense
      rows={trials}
      rowKey={(trial) => `${String(trial.trial_index)}-${String(trial.play)}`}
      columns={COLUMNS}
      empty="No ratings."
    />
  );
}

/** One tick a drawn frame, on a line of time. */
function Ticks({ drawn }: { drawn: number[][] }) {
  const times = drawn.map((pair) => pair[1] ?? 0);
  const start = times[0] ?? 0;
  const length = Math.max(1, (times.at(-1) ?? 0) - start);
  return (
    <svg viewBox="0 0 220 12" width={220} height={12} role="img" aria-label={`${times.length} frames in ${length.toFixed(0)} ms`}>
      {times.map((time, index) => {
        const x = 1 + (218 * (time - start)) / length;
        return <line key={index} x1={x} x2={x} y1={1} y2={11} stroke="currentColor" strokeWidth={1} />;
      })}
    </svg>
  );
}

/** A calibration as it is shown: what was not measured is left out. */
function calibrationFacts(one: Schemas["TimelineCalibration"]): Record<string, string | number> {
  const facts = {
    "px per mm": one.px_per_mm.toFixed(2),
    method: one.method,
    why: words(one.occasion),
    measurements: one.repeats,
    "spread, %": one.spread_percent,
    "ruler says": one.ruler_check && words(one.ruler_check),
    "difference at recheck, %": one.recheck_percent,
    "distance, mm": one.viewing_distance_mm,
    "distance by": one.distance_method && words(one.distance_method),
    "distance spread, mm": one.distance_spread_mm,
    zoom: one.zoom,
  };
  return Object.fromEntries(Object.entries(facts).filter((fact): fact is [string, string | number] => fact[1] !== null));
}

/** Whether the answers are likely a person's, and what speaks against it. */
function Evidence({ study, run }: { study: string; run: string }) {
  const { data } = useQuery({
    queryKey: ["timeline", study, run, "evidence"],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/runs/{run}/evidence", { params: { path: { study, run } } })),
  });
  if (data === undefined || data.verdict === "not_judged") return null;
  return (
    <Text size="sm" role="group" aria-label="A person">
      A person: <b>{data.verdict}</b> ({data.points} {data.points === 1 ? "point" : "points"}).{" "}
      {data.reasons.length > 0 && `${data.reasons.join(" ")} `}
      <Anchor href="/docs/explanation/evidence.html" target="_blank" rel="noopener">
        How this is judged
      </Anchor>
    </Text>
  );
}

export function TimelinePage() {
  const { study = "", run = "" } = useParams({ strict: false });
  const mayChange = useMay(study, "run");
  const mayErase = useMay(study, "edit");
  const owns = useMay(study, "own");
  const timeline = useQuery({
    queryKey: ["timeline", study, run],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/runs/{run}", { params: { path: { study, run } } })),
  });
  return (
    <Stack>
      <Anchor component={Link} to={`/studies/${study}/participants`}>
        All participants
      </Anchor>
      <Answer of={timeline}>
        {(data) => (
          <Stack>
            <Group justify="space-between" align="start">
              <div>
                <Title order={2} size="h3">
                  {data.summary.run === data.summary.participant ? (
                    <>
                      Run <CopyId value={data.summary.run} what="run id" />
                    </>
                  ) : (
                    data.summary.participant
                  )}
                </Title>
                <Text size="sm" c="dimmed">
                  {words(data.summary.status)}, began {when(data.summary.started_at)},{" "}
                  {data.consented_at === null ? "has not agreed" : `agreed ${when(data.consented_at)}`}, {data.summary.minutes.toFixed(1)}{" "}
                  minutes, language {data.summary.language}, through “{data.summary.link}”
                </Text>
                {data.summary.run !== data.summary.participant && (
                  <Text size="sm" c="dimmed" component="div">
                    Run <CopyId value={data.summary.run} what="run id" />
                  </Text>
                )}
                <Evidence study={study} run={run} />
                {data.summary.excluded && <Text c="var(--mantine-color-error)">Excluded: {data.summary.exclusion_reason}</Text>}
              </div>
              <Group>
                {data.summary.erased_at === null && (
                  <Button component={Link} to={`/studies/${study}/participants/${run}/replay`} variant="default">
                    Replay
                  </Button>
                )}
                {owns && data.summary.erased_at === null && (
                  <>
                    <IdentityButton study={study} run={run} />
                    <Button
                      component="a"
                      variant="default"
                      href={`/api/admin/studies/${study}/runs/${run}/subject-access`}
                      title="Everything stored about this person, as JSON"
                      download
                    >
                      Subject access
                    </Button>
                  </>
                )}
                {mayChange && data.summary.erased_at === null && <RunActions study={study} summary={data.summary} mayErase={mayErase} />}
              </Group>
            </Group>
            <Group align="stretch">
              {data.forms.map((form) => (
                <Facts key={form.form} title={`Form “${words(form.form)}”`} values={form.answers} />
              ))}
              {data.calibrations.map((one) => (
                <Facts key={one.saved_at} title="Calibration" values={calibrationFacts(one)} />
              ))}
              <Facts title="Device" values={data.device} />
            </Group>
            <RefusedRecords events={data.events} />
            <TrialTable trials={data.trials} />
            {data.events.length > 0 && (
              <Card withBorder>
                <Title order={3} size="h5">
                  Events
                </Title>
                {data.events.map((event, index) => (
                  <Text size="sm" key={`${event.received_at}${String(index)}`}>
                    {when(event.received_at)}: {words(event.type)}
                  </Text>
                ))}
              </Card>
            )}
          </Stack>
        )}
      </Answer>
    </Stack>
  );
}

/** Answers and views that the server could not store, with the reason; the participant was not held up by them. */
function RefusedRecords({ events }: { events: Schemas["TimelineEvent"][] }) {
  const refused = events.filter(({ type }) => type === "record_refused");
  if (refused.length === 0) return null;
  return (
    <Card withBorder>
      <Title order={3} size="h5">
        Not stored: {refused.length}
      </Title>
      <Text size="sm">The participant continued without these records. They count as answered; the exports do not contain them.</Text>
      {refused.map(({ received_at, data }, index) => (
        <Text size="sm" key={`${received_at}${String(index)}`} className="wrap-anywhere">
          {when(received_at)}: {data["trial_index"] === undefined ? plain(data["path"]) : `trial ${plain(data["trial_index"])}`},{" "}
          {plain(data["reason"]) || words(plain(data["code"]))} ({plain(data["status"])})
        </Text>
      ))}
    </Card>
  );
}

function Facts({ title, values }: { title: string; values: Record<string, unknown> }) {
  const entries = Object.entries(values);
  if (entries.length === 0) return null;
  return (
    <Card withBorder padding="sm" maw={420}>
      <Title order={3} size="h5">
        {title}
      </Title>
      {entries.map(([name, value]) => (
        <Text size="sm" key={name} className="wrap-anywhere">
          {words(name)}: {plain(value)}
        </Text>
      ))}
    </Card>
  );
}
