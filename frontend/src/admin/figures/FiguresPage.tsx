/** The recorded blinks and the model behind the clips. */
import { Stack, Tabs, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "../api";
import { Answer, onDemand } from "../ui/Answer";

const ModelSliders = onDemand(async () => (await import("./ModelSliders")).ModelSliders);
const Recorded = onDemand(async () => (await import("./Recorded")).Recorded);
const Playground = onDemand(async () => (await import("./Playground")).Playground);

export function FiguresPage() {
  const library = useQuery({
    queryKey: ["library"],
    queryFn: () => unwrap(api.GET("/api/admin/blinks/library")),
    staleTime: Number.POSITIVE_INFINITY,
  });
  return (
    <Stack>
      <Title order={1}>Blinks</Title>
      <Text maw={720}>
        The recorded blinks that clips use, the PCA model fitted to them, and the engine for whole performances. Closure is 0 for an open
        eye and 1 for a closed eye, at 300 samples per second.
      </Text>
      <Answer of={library}>
        {(data) => (
          <Tabs defaultValue="model" keepMounted={false}>
            <Tabs.List>
              <Tabs.Tab value="model">Model</Tabs.Tab>
              <Tabs.Tab value="recorded">Recorded ({numberOf(data)})</Tabs.Tab>
              <Tabs.Tab value="playground">Playground</Tabs.Tab>
            </Tabs.List>
            <Tabs.Panel value="model" pt="md">
              <ModelSliders library={data} />
            </Tabs.Panel>
            <Tabs.Panel value="recorded" pt="md">
              <Recorded library={data} />
            </Tabs.Panel>
            <Tabs.Panel value="playground" pt="md">
              <Playground />
            </Tabs.Panel>
          </Tabs>
        )}
      </Answer>
    </Stack>
  );
}

/** "21 + 9 in both eyes": as `stimuli profiles` counts, which separates single blinks from pairs. */
function numberOf({ profiles }: Schemas["BlinkLibrary"]): string {
  const pairs = profiles.filter(({ eye }) => eye === "both").length;
  return `${profiles.length - pairs}${pairs > 0 ? ` + ${pairs} in both eyes` : ""}`;
}
