/** What a rehearsal showed, a card each. */

import { Anchor, Card, Code, Group, SegmentedControl, Table, Text, Title } from "@mantine/core";
import { type ReactNode, useState } from "react";
import type { Schemas } from "../api";
import { DataTable } from "../ui/DataTable";
import { fixed, words } from "../ui/format";

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

export function Summary({ result }: Props) {
  const minutes = result.people.map((person) => person.minutes).sort((one, other) => one - other);
  const [fewest, most] = [fixed(minutes[0], 1), fixed(minutes.at(-1), 1)];
  return (
    <Part title="Time">
      <Text>
        {result.complete} of {result.participants} came to the end and left {result.answers} answers. By the declared seconds a trial, the
        trials take {fixed(result.expected_minutes, 1)} minutes; by clips and simulated answers{" "}
        {fewest === most ? most : `${fewest} to ${most}`} minutes, without consent, forms, instructions and breaks.
      </Text>
    </Part>
  );
}

export function Report({ result, address }: Props & { address: string }) {
  return (
    <Part title="The report they would give">
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

export function PowerOfPlan({ result: { power, power_problem } }: Props) {
  return (
    <Part title="Power of the plan">
      {power === null ? (
        <Text>Not reckoned: {power_problem}.</Text>
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

export function Order({ result: { people } }: Props) {
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

export function Columns({ result: { columns } }: Props) {
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
