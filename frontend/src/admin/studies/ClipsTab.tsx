import { Button, Group, Stack, Text, TextInput, Select } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState, useMemo } from "react";
import { api, unwrap, studyQuery, type Schemas, clipsQuery, useMay } from "../api";
import { forgetWork, keptWork } from "../builder/kept";
import { UploadClips, StillNeeded } from "../clips/UploadClips";
import { playNeeded, useUpload } from "../clips/useUpload";
import { useChange } from "../ui/useChange";
import { declaredPattern, patternProblem } from "./file-pattern";
import { useParams } from "@tanstack/react-router";
import { Answer, onDemand } from "../ui/Answer";
import { counted } from "../ui/format";

const ClipGrid = onDemand(async () => (await import("../clips/ClipCard")).ClipGrid);

// Further clips, or others in the place of those there are: saved as a new version.

function AddClips({ study }: { study: string }) {
  const detail = useQuery(studyQuery(study)).data;
  const sent = useUpload(`study ${study}`);
  const upload = sent.received;
  const [typed, setPattern] = useState<string | null>(null);
  const files = upload?.files.map(({ name }) => name) ?? [];
  const pattern = typed ?? (declaredPattern(detail?.design.factors ?? [], files) || (upload?.suggested_pattern ?? ""));
  const needed = upload?.has_manifest === true ? false : patternProblem(pattern, files);
  const notPlayed = playNeeded(sent);
  const kept = keptWork(study);
  // The builder saves clips in other cells itself.
  const moved = kept?.places != null && "clips that were moved in the builder saved, or discarded there";
  const save = useChange(
    () => {
      const revision = detail?.summary.revision ?? 1;
      const levels = upload?.has_manifest === true ? null : { pattern };
      const body = { revision, toml: kept?.toml ?? detail?.toml ?? "", note: "clips", upload: upload?.id ?? null, levels };
      return unwrap(api.POST("/api/admin/studies/{study}/versions", { params: { path: { study } }, body }));
    },
    {
      touches: [
        ["study", study],
        ["clips", study],
      ],
      done: "Saved as a new version.",
      before: () => forgetWork(study),
      then: sent.forget,
    },
  );
  return (
    <details className="element">
      <summary>Add or replace clips</summary>
      <Stack gap="sm" mt="xs">
        <Text size="sm">
          A clip replaces the one with the same levels and exemplar. For a new level, add the level in the builder first, leave it unsaved,
          and return here; both are saved together.
          {kept !== null && moved === false && " Unsaved work of the builder will be saved with them."}
        </Text>
        <UploadClips upload={sent} />
        {upload !== null && upload.files.length > 0 && (
          <Group align="end">
            {!upload.has_manifest && (
              <TextInput
                label="Pattern"
                description="Names of factors in braces."
                value={pattern}
                onChange={(event) => setPattern(event.currentTarget.value)}
                w={340}
              />
            )}
            <Button
              loading={save.isPending}
              disabled={detail === undefined || [needed, notPlayed, moved].some(Boolean)}
              onClick={() => save.mutate(undefined)}
            >
              Save as a new version
            </Button>
            <StillNeeded parts={[needed, notPlayed, moved]} />
          </Group>
        )}
      </Stack>
    </details>
  );
}

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
