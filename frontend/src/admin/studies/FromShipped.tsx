import { Alert, Anchor, Button, Card, Group, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { api, unwrap } from "../api";
import { studiesQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { useCreate } from "./useCreate";

export function FromShipped({ name, onTaken }: { name: string; onTaken: (message: string) => void }) {
  const shipped = useQuery({ queryKey: ["experiments"], queryFn: () => unwrap(api.GET("/api/admin/experiments")) });
  const create = useCreate(onTaken);
  const present = new Set(useQuery(studiesQuery).data?.map((study) => study.name));
  return (
    <Answer of={shipped}>
      {(experiments) => (
        <Stack>
          <Text size="sm">
            The three experiments of the paper, and demonstrations whose clips are built here, ready to run; you can change texts and
            settings afterwards.
          </Text>
          <SimpleGrid cols={{ base: 1, sm: 3 }}>
            {experiments.map((experiment) => (
              <Card withBorder key={experiment.name}>
                <Title order={2} size="h4">
                  {experiment.title}
                </Title>
                <Text size="sm" c="dimmed" mb="md">
                  {experiment.name}
                </Text>
                {name === "" && present.has(experiment.name) ? (
                  <Text size="sm" mt="auto">
                    It is{" "}
                    <Anchor component={Link} to={`/studies/${experiment.name}`} underline="always">
                      there already
                    </Anchor>
                    . Give a short name above for another one of it.
                  </Text>
                ) : experiment.clips_ready ? (
                  <Group mt="auto">
                    <Button
                      loading={create.isPending && create.variables.shipped === experiment.name}
                      onClick={() => create.mutate({ name: name || experiment.name, shipped: experiment.name })}
                    >
                      Create “{name || experiment.name}”
                    </Button>
                  </Group>
                ) : (
                  <Alert color="yellow">
                    Its clips are not built on this server. Run <code>make run</code>, or upload them.
                  </Alert>
                )}
              </Card>
            ))}
          </SimpleGrid>
        </Stack>
      )}
    </Answer>
  );
}
