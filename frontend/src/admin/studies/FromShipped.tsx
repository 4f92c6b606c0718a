import { Alert, Anchor, Button, Card, Group, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { api, unwrap, type Schemas } from "../api";
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
            The three experiments of the paper, and demonstrations whose clips are built here; you can change texts and settings afterwards.
          </Text>
          <SimpleGrid cols={{ base: 1, sm: 3 }}>
            {experiments
              .filter((one) => !isUnbuiltDemo(one))
              .map((experiment) => (
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
                    <Alert color="yellow" className="wrap-anywhere">
                      Its clips are not built on this server. Run <code>{experiment.build}</code> there, or upload them.
                    </Alert>
                  )}
                </Card>
              ))}
          </SimpleGrid>
          <Unbuilt demos={experiments.filter((one) => isUnbuiltDemo(one) && !present.has(one.name))} />
        </Stack>
      )}
    </Answer>
  );
}

type Shipped = Schemas["ShippedExperiment"];

function isUnbuiltDemo({ demonstration, clips_ready }: Shipped): boolean {
  return demonstration && !clips_ready;
}

function Unbuilt({ demos }: { demos: Shipped[] }) {
  if (demos.length === 0) return null;
  return (
    <Text size="sm" component="div">
      Demonstrations whose clips are not built yet, each with the command that builds them on the server:
      <ul>
        {demos.map(({ name, title, build }) => (
          <li key={name}>
            {title}: <code>{build}</code>
          </li>
        ))}
      </ul>
    </Text>
  );
}
