/** A row of figures, each with what it counts. */

import { Card, SimpleGrid, Text } from "@mantine/core";

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
