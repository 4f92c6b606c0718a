/** What a definition expands to: factors, cells, blocks, minutes; and its text, with each problem at its line. */

import { Card, SimpleGrid, Text, Badge, Group, List, Stack, Table, Title, Alert, Textarea } from "@mantine/core";
import type { Schemas } from "../api";
import { counted } from "../ui/format";
import { useRef } from "react";

// A row of figures, each with what it counts.

export function Figures({ figures }: { figures: readonly [label: string, value: string | number][] }) {
  return (
    <SimpleGrid cols={{ base: 2, sm: figures.length }} spacing="sm">
      {figures.map(([label, value]) => (
        <Card withBorder key={label} padding="sm">
          <Text size="xl" fw={600} lh={1.3} className="number">
            {value}
          </Text>
          <Text size="sm" c="dimmed">
            {label}
          </Text>
        </Card>
      ))}
    </SimpleGrid>
  );
}

// What a definition expands to: factors, cells, blocks, minutes.

export function Design({ design }: { design: Schemas["DesignOut"] }) {
  const figures: [string, string | number][] = [
    ["cells", design.cells],
    ["clips per cell", design.exemplars],
    ["clips", design.unique_clips],
    ["trials per participant", design.trials_per_participant],
    ["expected minutes", design.expected_minutes.toFixed(0)],
  ];
  return (
    <Stack>
      <Figures figures={figures} />
      {design.notes.length > 0 && (
        <List size="sm">
          {design.notes.map((note) => (
            <List.Item key={note}>{note}</List.Item>
          ))}
        </List>
      )}
      <Title order={2} size="h4">
        Factors
      </Title>
      <Table>
        <Table.Tbody>
          {design.factors.map((factor) => (
            <Table.Tr key={factor.name}>
              <Table.Th scope="row" w="30%">
                {factor.label}
              </Table.Th>
              <Table.Td>
                <Group gap={6}>
                  {factor.levels.map(({ name, label }) => (
                    <Badge key={name} variant="default" title={name}>
                      {label}
                    </Badge>
                  ))}
                </Group>
              </Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
      <Title order={2} size="h4">
        Blocks
      </Title>
      <Group gap={6}>
        {design.blocks.map((block, index) => (
          <Badge key={`${block.label}-${String(index)}`} variant="default">
            {block.label}: {counted(block.trials, "trial")}
          </Badge>
        ))}
      </Group>
    </Stack>
  );
}

/** The same on one line, with what is to be said of it. */
export function DesignLine({ design }: { design: Schemas["DesignOut"] }) {
  const { cells, exemplars, unique_clips, trials_per_participant, expected_minutes, notes } = design;
  return (
    <div>
      <Text size="sm" role="status" aria-label="Size of the design">
        {counted(cells, "cell")} with {counted(exemplars, "clip")} each, {counted(unique_clips, "clip")} in all;{" "}
        {counted(trials_per_participant, "trial")} per participant, about {counted(Math.max(1, Math.round(expected_minutes)), "minute")}
      </Text>
      {notes.map((note) => (
        <Text key={note} size="sm">
          {note}
        </Text>
      ))}
    </div>
  );
}

// A declaration's text, and its problems, each at its line.

interface Props {
  toml: string;
  onChange: (toml: string) => void;
  problems: readonly Schemas["ProblemOut"][];
  rows?: number;
}

export function TomlText({ toml, onChange, problems, rows = 28 }: Props) {
  const area = useRef<HTMLTextAreaElement>(null);
  const goTo = (line: number) => {
    const start =
      toml
        .split("\n")
        .slice(0, line - 1)
        .join("\n").length + (line > 1 ? 1 : 0);
    const end = toml.indexOf("\n", start);
    area.current?.focus();
    area.current?.setSelectionRange(start, end === -1 ? toml.length : end);
  };
  return (
    <div>
      <Textarea
        ref={area}
        className="editor"
        aria-label="Definition"
        autosize
        minRows={12}
        maxRows={rows}
        spellCheck={false}
        value={toml}
        onChange={(event) => onChange(event.currentTarget.value)}
      />
      {problems.length > 0 && (
        <Alert color="red" variant="light" title="Not ready yet" my="sm" role="status">
          <List size="sm">
            {problems.map((problem) => (
              <List.Item key={`${String(problem.line)}${problem.path}${problem.message}`}>
                {problem.line !== null && (
                  <button type="button" className="line-link" onClick={() => goTo(problem.line ?? 1)}>
                    Line {problem.line}
                  </button>
                )}{" "}
                {problem.path}: {problem.message}
              </List.Item>
            ))}
          </List>
        </Alert>
      )}
    </div>
  );
}
