import { Group, Progress, Stack, Text, Title } from "@mantine/core";
import type { Schemas } from "../api";

export function Funnel({ steps }: { steps: Schemas["FunnelStep"][] }) {
  const all = Math.max(1, steps[0]?.runs ?? 0);
  return (
    <Stack gap={4} maw={640}>
      <Title order={2} size="h4">
        How far people come
      </Title>
      {steps.map((step) => (
        <Group key={step.stage} gap="sm" wrap="nowrap">
          <Text size="sm" w={110}>
            {step.stage.replace("_", " ")}
          </Text>
          <Progress value={(100 * step.runs) / all} size="lg" flex={1} aria-label={`${step.runs} reached ${step.stage}`} />
          <Text size="sm" w={40} ta="end" className="number">
            {step.runs}
          </Text>
        </Group>
      ))}
    </Stack>
  );
}
