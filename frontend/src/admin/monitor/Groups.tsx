import { Card, Group, Progress, Stack, Text, Title } from "@mantine/core";
import type { Schemas } from "../api";

/** How many are in each group of participants, and how many it takes. */
export function Groups({ groups }: { groups: Schemas["GroupCount"][] }) {
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
                <Progress.Section value={(100 * active) / all} color="gray" aria-label={`${active} under way in ${name}`} />
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
