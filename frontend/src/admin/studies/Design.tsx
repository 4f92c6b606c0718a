/** What a definition expands to: factors, cells, blocks, minutes. */

import { Badge, Group, List, Stack, Table, Title } from "@mantine/core";
import type { Schemas } from "../api";
import { Figures } from "../ui/Figures";
import { counted } from "../ui/format";

export function Design({ design }: { design: Schemas["DesignOut"] }) {
  const figures: [string, string | number][] = [
    ["cells", design.cells],
    ["clips a cell", design.exemplars],
    ["clips", design.unique_clips],
    ["trials a participant", design.trials_per_participant],
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
