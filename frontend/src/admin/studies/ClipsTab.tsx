import { Group, Select, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useMemo, useState } from "react";
import type { Schemas } from "../api";
import { ClipGrid } from "../clips/ClipGrid";
import { clipsQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { counted } from "../ui/format";
import { AddClips } from "./AddClips";

export function ClipsTab() {
  const { study = "" } = useParams({ strict: false });
  return <Answer of={useQuery(clipsQuery(study))}>{(clips) => <Clips study={study} clips={clips} />}</Answer>;
}

function Clips({ study, clips }: { study: string; clips: Schemas["ClipOut"][] }) {
  const mayChange = useMay(study, "edit");
  const [cell, setCell] = useState<string | null>(null);
  const cells = useMemo(() => [...new Set(clips.map((clip) => clip.cell))], [clips]);
  const chosen = useMemo(() => clips.filter((clip) => cell === null || clip.cell === cell), [clips, cell]);
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
          limit={100}
          onChange={setCell}
          w={340}
        />
        <Text size="sm">{counted(chosen.length, "clip")}</Text>
      </Group>
      <ClipGrid key={cell} study={study} clips={chosen} />
    </Stack>
  );
}
