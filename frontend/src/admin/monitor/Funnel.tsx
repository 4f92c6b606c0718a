import { Card, Group, Progress, Stack, Text, Title } from "@mantine/core";
import type { Schemas } from "../api";
import { words } from "../ui/format";

export function Funnel({ steps }: { steps: Schemas["FunnelStep"][] }) {
  const all = Math.max(1, steps[0]?.runs ?? 0);
  return (
    <Card withBorder>
      <Stack gap={4}>
        <Title order={2} size="h4">
          How far people come
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
