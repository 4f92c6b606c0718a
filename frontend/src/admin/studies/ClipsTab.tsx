import { Badge, Card, Group, Pagination, Select, SimpleGrid, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useMemo, useState } from "react";
import type { Schemas } from "../api";
import { clipsQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { PlotFigure } from "../ui/PlotFigure";
import { closurePlot } from "./closurePlot";

const A_PAGE = 6;

export function ClipsTab() {
  const { study = "" } = useParams({ strict: false });
  return <Answer of={useQuery(clipsQuery(study))}>{(clips) => <Clips clips={clips} />}</Answer>;
}

function Clips({ clips }: { clips: Schemas["ClipOut"][] }) {
  const [cell, setCell] = useState<string | null>(null);
  const [page, setPage] = useState(1);
  const cells = useMemo(() => [...new Set(clips.map((clip) => clip.cell))], [clips]);
  const chosen = clips.filter((clip) => cell === null || clip.cell === cell);
  return (
    <Stack>
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
      <Pagination
        total={Math.ceil(chosen.length / A_PAGE)}
        value={page}
        onChange={setPage}
        getControlProps={(control) => ({ "aria-label": `${control} page` })}
      />
    </Stack>
  );
}

export function ClipCard({ clip }: { clip: Schemas["ClipOut"] }) {
  const options = useMemo(() => closurePlot(clip.closure), [clip.closure]);
  return (
    <Card withBorder padding="sm">
      <video className="clip" src={clip.url} controls muted loop preload="metadata" aria-label={`${clip.cell}, ${clip.exemplar}`} />
      <Group justify="space-between" mt="xs">
        <Text size="sm" className="wrap-anywhere">
          {clip.cell}
        </Text>
        <Badge variant="default">no. {clip.exemplar}</Badge>
      </Group>
      <Text size="xs" c="dimmed">
        {clip.profile !== "" && `${clip.profile}, `}
        {clip.frames} frames at {clip.fps} fps, {Math.round(clip.bytes / 1024)} KiB
      </Text>
      {clip.closure.length > 0 && <PlotFigure options={options} label="Closure over time" />}
    </Card>
  );
}
