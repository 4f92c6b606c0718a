/** The dress rehearsal: simulated people in a sandbox, and what they would leave behind. */

import { Anchor, Card, Code, Group, SegmentedControl, Table, Text, Title, Alert, Button, Progress, Stack } from "@mantine/core";
import { type ReactNode, useState } from "react";
import { type Schemas, api, unwrap, useMay } from "../api";
import { DataTable } from "../ui/DataTable";
import { fixed, words, counted, when } from "../ui/format";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { Answer } from "../ui/Answer";
import { useChange } from "../ui/useChange";
import { faultOf, type Typed, WholeNumber } from "../ui/WholeNumber";

// What a rehearsal showed, a card each.

interface Props {
  result: Schemas["RehearsalResult"];
}

function Part({ title, children }: { title: string; children: ReactNode }) {
  return (
    <Card withBorder>
      <Title order={3} size="h4" mb="xs">
        {title}
      </Title>
      {children}
    </Card>
  );
}

function Summary({ result }: Props) {
  const minutes = result.people.map((person) => person.minutes).sort((one, other) => one - other);
  const [fewest, most] = [fixed(minutes[0], 1), fixed(minutes.at(-1), 1)];
  return (
    <Part title="Time">
      <Text>
        {result.complete} of {result.participants} came to the end and left {result.answers} answers. At the declared seconds per trial, the
        trials take {fixed(result.expected_minutes, 1)} minutes; by clips and simulated answers{" "}
        {fewest === most ? most : `${fewest} to ${most}`} minutes, without consent, forms, instructions and breaks.
      </Text>
    </Part>
  );
}

function Report({ result, address }: Props & { address: string }) {
  return (
    <Part title="Resulting report">
      {result.report_problem !== "" && <Text>No report: {result.report_problem}</Text>}
      <Group gap="sm">
        {result.report.map((file) => (
          <Anchor key={file} href={address + file} target="_blank" rel="noopener" size="sm">
            {file}
          </Anchor>
        ))}
      </Group>
    </Part>
  );
}

function PowerOfPlan({ result: { power, power_problem } }: Props) {
  return (
    <Part title="Power of the plan">
      {power === null ? (
        <Text>Not computed: {power_problem}.</Text>
      ) : (
        <>
          <Text mb="sm">Assumed: {power.assumed}. Only you know whether that fits; this is the command to change:</Text>
          <Code className="wrap-anywhere">{power.command}</Code>
          <div className="scroll-x" tabIndex={0} role="region" aria-label="Power by participants">
            <Table my="sm">
              <Table.Thead>
                <Table.Tr>
                  <Table.Th>Participants</Table.Th>
                  {power.n.map((n) => (
                    <Table.Th key={n}>{n}</Table.Th>
                  ))}
                </Table.Tr>
              </Table.Thead>
              <Table.Tbody>
                {power.effects.map((effect, row) => (
                  <Table.Tr key={effect}>
                    <Table.Td>{effect}</Table.Td>
                    {power.power[row]?.map((value, column) => (
                      <Table.Td key={column} className="number">
                        {fixed(value)}
                      </Table.Td>
                    ))}
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </div>
          <Text size="sm" c="dimmed">
            {power.text}
          </Text>
        </>
      )}
    </Part>
  );
}

function Order({ result: { people } }: Props) {
  const [number, setNumber] = useState("1");
  const person = people.find((one) => String(one.number) === number) ?? people[0];
  if (person === undefined) return null;
  return (
    <Part title="Order">
      <SegmentedControl
        aria-label="Simulated person"
        value={number}
        onChange={setNumber}
        data={people.map((one) => ({ value: String(one.number), label: `Person ${one.number}` }))}
        mb="sm"
      />
      <Text size="sm" mb="xs">
        {words(person.status)}, {fixed(person.minutes, 1)} minutes{person.group !== "" && `, group ${person.group}`}
      </Text>
      <DataTable
        dense
        rows={person.trials}
        rowKey={(trial) => String(trial.trial_index)}
        empty="No trials."
        columns={[
          { title: "Trial", number: true, cell: (trial) => trial.trial_index },
          { title: "Part", cell: (trial) => trial.kind },
          { title: "Block", wide: true, cell: (trial) => trial.block || "–" },
          { title: "Clips", wrap: true, cell: (trial) => trial.clips.join(" | ") || "–" },
        ]}
      />
    </Part>
  );
}

function Columns({ result: { columns } }: Props) {
  return (
    <Part title="Columns">
      <DataTable
        dense
        rows={columns}
        rowKey={(column) => `${column.table} ${column.name}`}
        empty="No columns."
        columns={[
          { title: "Table", wide: true, cell: (column) => column.table },
          { title: "Column", wrap: true, cell: (column) => column.name },
          { title: "Example", wrap: true, cell: (column) => column.example || "–" },
          { title: "Meaning", wide: true, wrap: true, cell: (column) => column.meaning },
        ]}
      />
    </Part>
  );
}

type Rehearsal = Schemas["RehearsalOut"];

const PEOPLE = { min: 1, max: 60 };
const isUnderWay = ({ status }: Rehearsal): boolean => status === "queued" || status === "running";

export function RehearsalTab() {
  const { study = "" } = useParams({ strict: false });
  const path = { params: { path: { study } } };
  const mayBegin = useMay(study, "run");
  const [participants, setParticipants] = useState<Typed>(8);
  const latest = useQuery({
    queryKey: ["rehearsal", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/rehearsals/latest", path)),
    refetchInterval: ({ state }) => (state.data && isUnderWay(state.data) ? 1_000 : false),
  });
  const begin = useChange(
    () => unwrap(api.POST("/api/admin/studies/{study}/rehearsals", { ...path, body: { participants: Number(participants), seed: 1 } })),
    { touches: [["rehearsal", study]] },
  );
  const busy = latest.data ? isUnderWay(latest.data) : false;
  return (
    <Stack>
      <Card withBorder>
        <Title order={2} size="h4">
          Rehearsal
        </Title>
        <Text size="sm" mt={4} mb="md" maw={720}>
          Simulated participants complete the whole study in a temporary database that is deleted afterwards. You see the order, the time,
          the columns, the report and the power of the plan. Your data are untouched. Simulated answers say nothing about people.
        </Text>
        {mayBegin && (
          <Group align="end">
            <WholeNumber label="Simulated people" {...PEOPLE} w={150} value={participants} onChange={setParticipants} />
            <Button
              onClick={() => begin.mutate(undefined)}
              loading={begin.isPending}
              disabled={busy || faultOf(participants, PEOPLE) !== null}
            >
              Rehearse
            </Button>
          </Group>
        )}
      </Card>
      <Answer of={latest}>
        {(data) =>
          data === null ? (
            <Text c="dimmed">Not rehearsed yet. Choose a number of people and press Rehearse.</Text>
          ) : (
            <Latest study={study} rehearsal={data} />
          )
        }
      </Answer>
    </Stack>
  );
}

const WORDS: Record<Rehearsal["status"], string> = {
  queued: "Rehearsing",
  running: "Rehearsing",
  done: "Rehearsed",
  failed: "Failed",
  cancelled: "Cancelled",
};

function Latest({ study, rehearsal }: { study: string; rehearsal: Rehearsal }) {
  const { id, status, progress, message } = rehearsal;
  const mayEnd = useMay(study, "run");
  const path = { params: { path: { study, rehearsal: id } } };
  const cancel = useChange(() => unwrap(api.POST("/api/admin/studies/{study}/rehearsals/{rehearsal}/cancel", path)), {
    touches: [["rehearsal", study]],
  });
  return (
    <Stack>
      <Group gap="sm" role="status" aria-label="Rehearsal">
        <Text size="sm">
          {WORDS[status]}, version {rehearsal.version} with {counted(rehearsal.participants, "participant")}, {when(rehearsal.created_at)}
        </Text>
        {isUnderWay(rehearsal) && (
          <>
            <Progress w={200} value={100 * progress} animated aria-label="Progress of the rehearsal" />
            <Text size="sm">{message}</Text>
            {mayEnd && (
              <Button size="compact-sm" variant="default" loading={cancel.isPending} onClick={() => cancel.mutate(undefined)}>
                Cancel
              </Button>
            )}
          </>
        )}
      </Group>
      {status === "failed" && (
        <Alert color="red" variant="light" title="The rehearsal stopped" role="alert">
          {message}
        </Alert>
      )}
      {status === "done" && <Shown study={study} rehearsal={rehearsal.id} />}
    </Stack>
  );
}

function Shown({ study, rehearsal }: { study: string; rehearsal: string }) {
  const result = useQuery({
    queryKey: ["rehearsal shown", study, rehearsal],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/rehearsals/{rehearsal}", { params: { path: { study, rehearsal } } })),
    staleTime: Infinity,
  });
  return (
    <Answer of={result}>
      {(data) => (
        <Stack>
          <Summary result={data} />
          <Report result={data} address={`/api/admin/studies/${study}/rehearsals/${rehearsal}/report/`} />
          <PowerOfPlan result={data} />
          <Order result={data} />
          <Columns result={data} />
        </Stack>
      )}
    </Answer>
  );
}
