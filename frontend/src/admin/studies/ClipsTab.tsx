import { Card, Group, Select, SimpleGrid, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useMemo, useState } from "react";
import type { Schemas } from "../api";
import { clipsQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { Pages } from "../ui/DataTable";
import { PlotFigure } from "../ui/PlotFigure";
import { AddClips } from "./AddClips";
import { ClipVideo } from "./ClipVideo";
import { closurePlot } from "./closurePlot";

const A_PAGE = 6;

export function ClipsTab() {
  const { study = "" } = useParams({ strict: false });
  return <Answer of={useQuery(clipsQuery(study))}>{(clips) => <Clips study={study} clips={clips} />}</Answer>;
}

function Clips({ study, clips }: { study: string; clips: Schemas["ClipOut"][] }) {
  const mayChange = useMay(study, "edit");
  const [cell, setCell] = useState<string | null>(null);
  const [page, setPage] = useState(1);
  const cells = useMemo(() => [...new Set(clips.map((clip) => clip.cell))], [clips]);
  const chosen = clips.filter((clip) => cell === null || clip.cell === cell);
  return (
    <Stack>
      {mayChange && <AddClips study={study} />}
      <Group justify="space-between" align="end">
        <Select
          label="Cell"
          placeholder="all cells"
          data={cells}
          value={cell}
          clearable
          searchable
          onChange={(value) => {
            setCell(value);
            setPage(1);
          }}
          w={340}
        />
        <Text size="sm">{chosen.length} clips</Text>
      </Group>
      <SimpleGrid cols={{ base: 1, sm: 2, lg: 3 }}>
        {chosen.slice((page - 1) * A_PAGE, page * A_PAGE).map((clip) => (
          <ClipCard key={`${clip.cell}${String(clip.exemplar)}`} clip={clip} />
        ))}
      </SimpleGrid>
      {chosen.length > A_PAGE && <Pages total={Math.ceil(chosen.length / A_PAGE)} value={page} onChange={setPage} />}
    </Stack>
  );
}

export function ClipCard({ clip }: { clip: Schemas["ClipOut"] }) {
  const options = useMemo(() => closurePlot(clip.closure), [clip.closure]);
  return (
    <Card withBorder padding="sm">
      <Text size="sm" fw={600} className="wrap-anywhere" mb={6}>
        {clip.cell}, no. {clip.exemplar}
      </Text>
      <ClipVideo url={clip.url} label={`${clip.cell}, no. ${clip.exemplar}`} />
      <Text size="xs" c="dimmed" mt={6} className="wrap-anywhere">
        {clip.profile !== "" && `${clip.profile}, `}
        {clip.frames} frames at {clip.fps} fps, {Math.round(clip.bytes / 1024)} KiB
      </Text>
      {clip.closure.length > 0 && <PlotFigure options={options} label="Closure over time" />}
    </Card>
  );
}
