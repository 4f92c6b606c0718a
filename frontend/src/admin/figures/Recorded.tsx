import * as Plot from "@observablehq/plot";
import { Button, Card, Group, SimpleGrid, Stack, Text } from "@mantine/core";
import { useMemo } from "react";
import type { Schemas } from "../api";
import { closurePlot } from "../studies/closurePlot";
import { downloadText } from "../ui/download";
import { PlotFigure } from "../ui/PlotFigure";

type Profile = Schemas["RecordedProfile"];

export function Recorded({ library }: { library: Schemas["BlinkLibrary"] }) {
  const all = useMemo(() => alignedPlot(library.profiles, library.fps), [library]);
  return (
    <Stack>
      <Card withBorder maw={720}>
        <PlotFigure options={all} label="All recorded blinks aligned at their minimum" />
      </Card>
      <SimpleGrid cols={{ base: 1, sm: 2, lg: 3 }}>
        {library.profiles.map((profile) => (
          <One key={profile.profile_id} profile={profile} />
        ))}
      </SimpleGrid>
    </Stack>
  );
}

function alignedPlot(profiles: readonly Profile[], fps: number): Plot.PlotOptions {
  const rows = profiles.flatMap((profile) =>
    profile.closure.map((closure, frame) => ({
      id: profile.profile_id,
      person: profile.person,
      time: ((frame - profile.minimum_index) * 1000) / fps,
      closure,
    })),
  );
  return {
    height: 260,
    x: { label: "time from the minimum (ms)" },
    y: { domain: [1, 0], label: "closure" },
    color: { legend: true, label: "person" },
    marks: [Plot.line(rows, { x: "time", y: "closure", z: "id", stroke: "person", strokeOpacity: 0.6 })],
  };
}

function One({ profile }: { profile: Profile }) {
  const options = useMemo(() => closurePlot(profile.closure), [profile]);
  return (
    <Card withBorder padding="sm">
      <Group justify="space-between">
        <Text size="sm" fw={600}>
          {profile.profile_id}
        </Text>
        <Button
          size="compact-xs"
          variant="default"
          onClick={() => downloadText(`${profile.profile_id}.csv`, curveCsv(profile.closure))}
        >
          Download this curve
        </Button>
      </Group>
      <Text size="xs" c="dimmed">
        {profile.source} ({profile.licence})
      </Text>
      <PlotFigure options={options} label={`Closure of ${profile.profile_id}`} />
    </Card>
  );
}

/** A curve as the clip builder reads it: one closure sample a line. */
export function curveCsv(closure: readonly number[]): string {
  return `closure\n${closure.map((value) => value.toFixed(6)).join("\n")}\n`;
}
