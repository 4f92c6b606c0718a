import * as Plot from "@observablehq/plot";
import { Button, Card, Group, SegmentedControl, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useMemo, useState } from "react";
import type { Schemas } from "../api";
import { ClosureFigure, PlotFigure } from "../ui/PlotFigure";
import { downloadText } from "../ui/useChange";
import { Character } from "./Character";

type Profile = Schemas["RecordedProfile"];

function byEyes({ profiles }: Schemas["BlinkLibrary"]) {
  return { pairs: profiles.filter(isPair), singles: profiles.filter((one) => !isPair(one)) };
}

export function Recorded({ library }: { library: Schemas["BlinkLibrary"] }) {
  const [kind, setKind] = useState("one");
  const { pairs, singles } = useMemo(() => byEyes(library), [library]);
  const shown = kind === "both" ? pairs : singles;
  const [chosen, setChosen] = useState("");
  const current = shown.find((profile) => profile.profile_id === chosen) ?? shown[0];
  const aligned = useMemo(() => alignedPlot(shown, library.fps), [shown, library.fps]);
  return (
    <Stack>
      <Text size="sm" maw={720}>
        {singles.length} curves of one eye. {pairs.length} blinks were seen in both eyes: they are there once more as pairs, left and right
        on common samples, for clips whose eyes move separately.
      </Text>
      <SegmentedControl
        aria-label="Which blinks"
        style={{ alignSelf: "flex-start" }}
        value={kind}
        onChange={setKind}
        data={[
          { value: "one", label: `One eye (${singles.length})` },
          { value: "both", label: `Both eyes (${pairs.length})` },
        ]}
      />
      <SimpleGrid cols={{ base: 1, md: 2 }}>
        <Card withBorder>
          <Title order={2} size="h5" mb="xs">
            All, aligned at the moment the lid is lowest
          </Title>
          <PlotFigure options={aligned} label="Closure of all these blinks, aligned at their minimum" />
        </Card>
        {current !== undefined && (
          <Card withBorder>
            <Title order={2} size="h5" mb="xs">
              {nameOf(current)}
            </Title>
            <Character
              key={current.profile_id}
              closure={current.closure}
              {...(isPair(current) ? { other: current.closure_other } : {})}
              fps={library.fps}
            />
          </Card>
        )}
      </SimpleGrid>
      <SimpleGrid cols={{ base: 1, sm: 2, lg: 3 }}>
        {shown.map((profile) => (
          <One key={profile.profile_id} profile={profile} chosen={profile === current} onChoose={() => setChosen(profile.profile_id)} />
        ))}
      </SimpleGrid>
    </Stack>
  );
}

function isPair(profile: Profile): boolean {
  return profile.eye === "both";
}

const EYES: Record<string, string> = { left: "left eye", right: "right eye", both: "both eyes" };

/** "Person A, left eye, blink 3". */
function nameOf(profile: Profile): string {
  const number = /(\d+)$/.exec(profile.profile_id)?.[1];
  return [`Person ${profile.person}`, EYES[profile.eye] ?? "one eye", number === undefined ? "" : `blink ${Number(number)}`]
    .filter(Boolean)
    .join(", ");
}

function alignedPlot(profiles: readonly Profile[], fps: number): Plot.PlotOptions {
  const rows = profiles.flatMap((profile) =>
    profile.closure.map((closure, frame) => ({
      id: profile.profile_id,
      person: `person ${profile.person}`,
      time: ((frame - profile.minimum_index) * 1000) / fps,
      closure,
    })),
  );
  return {
    height: 240,
    marginBottom: 36,
    x: { label: "time (ms)" },
    y: { domain: [1, 0], label: "closure" },
    color: { legend: true, scheme: "observable10" },
    marks: [Plot.line(rows, { x: "time", y: "closure", z: "id", stroke: "person", strokeOpacity: 0.6 })],
  };
}

function One({ profile, chosen, onChoose }: { profile: Profile; chosen: boolean; onChoose: () => void }) {
  const file = `${profile.profile_id}.csv`;
  return (
    <Card withBorder padding="sm">
      <Text size="sm" fw={600}>
        {nameOf(profile)}
      </Text>
      <Text size="xs" c="dimmed">
        {profile.profile_id}, {profile.source} ({profile.licence})
      </Text>
      <ClosureFigure
        closure={profile.closure}
        other={profile.closure_other}
        height={120}
        label={`Closure of ${nameOf(profile)}${isPair(profile) ? "; the right eye dashed" : ""}`}
      />
      {isPair(profile) && (
        <Text size="xs" c="dimmed">
          left eye solid, right eye dashed
        </Text>
      )}
      <Group gap="xs" mt="auto">
        <Button
          size="compact-xs"
          variant={chosen ? "filled" : "default"}
          aria-label={`Show ${nameOf(profile)} on the character`}
          onClick={onChoose}
        >
          On the character
        </Button>
        <Button
          size="compact-xs"
          variant="default"
          aria-label={`Download the curve of ${nameOf(profile)}`}
          onClick={() => downloadText(file, curveCsv(profile.closure, profile.closure_other))}
        >
          Download this curve
        </Button>
      </Group>
    </Card>
  );
}

/** A curve as the clip builder reads it: one closure sample per line, with the right eye's next to it if there is one. */
export function curveCsv(closure: readonly number[], other: readonly number[] = []): string {
  const lines = closure.map((value, index) =>
    [value, other[index]]
      .filter((one) => one !== undefined)
      .map((one) => one.toFixed(6))
      .join(","),
  );
  return `closure${other.length > 0 ? ",closure_other" : ""}\n${lines.join("\n")}\n`;
}
