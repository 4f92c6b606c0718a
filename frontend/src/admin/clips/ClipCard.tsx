/** A clip with what it shows, and what it was converted from. */

import { Anchor, Card, Text } from "@mantine/core";
import type { Schemas } from "../api";
import { ClipVideo } from "../studies/ClipVideo";
import { counted } from "../ui/format";
import { onDemand } from "../ui/onDemand";
import { changesOf } from "./changes";

const ClosureFigure = onDemand(async () => (await import("../ui/ClosureFigure")).ClosureFigure);

/** @param label the cell's name; by itself that of its levels */
export function ClipCard({ study, clip, label = clip.cell }: { study: string; clip: Schemas["ClipOut"]; label?: string | undefined }) {
  const name = `${label}, no. ${clip.exemplar}`;
  return (
    <Card withBorder padding="sm">
      <Text size="sm" fw={600} className="wrap-anywhere" mb={6}>
        {name}
      </Text>
      <ClipVideo url={clip.url} label={name} />
      <Text size="xs" c="dimmed" mt={6} className="wrap-anywhere">
        {clip.profile !== "" && `${clip.profile}, `}
        {counted(clip.frames, "frame")} at {Number(clip.fps.toFixed(3))} fps, {Math.round(clip.bytes / 1024)} KiB
      </Text>
      {clip.source != null && <Origin study={study} source={clip.source} />}
      {clip.closure.length > 0 && <ClosureFigure closure={clip.closure} label="Closure over time" />}
    </Card>
  );
}

function Origin({ study, source }: { study: string; source: Schemas["SourceVideo"] }) {
  const address = `/api/admin/studies/${study}/originals/${source.sha256}`;
  return (
    <Text size="xs" c="dimmed" className="wrap-anywhere">
      Converted from{" "}
      <Anchor href={address} download size="xs" underline="always">
        {source.file}
      </Anchor>
      : {changesOf(source)}.{" "}
      <Anchor href={`${address}/frame-map.csv`} download size="xs" underline="always">
        Frame map
      </Anchor>
    </Text>
  );
}
