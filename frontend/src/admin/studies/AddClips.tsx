/** Further clips, or others in the place of those there are: saved as a new version. */

import { Button, FileInput, Group, Stack, Text, TextInput } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { forgetWork, keptWork } from "../builder/kept";
import { studyQuery } from "../queries";
import { useChange } from "../ui/useChange";
import { uploadFiles } from "./useCreate";

export function AddClips({ study }: { study: string }) {
  const detail = useQuery(studyQuery(study)).data;
  const [upload, setUpload] = useState<Schemas["UploadOut"] | null>(null);
  const [pattern, setPattern] = useState("");
  const kept = keptWork(study);
  const send = useChange(uploadFiles, {
    touches: [],
    then: (received) => {
      setUpload(received);
      setPattern(received.suggested_pattern ?? "");
    },
  });
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
      then: () => setUpload(null),
    },
  );
  return (
    <details className="element">
      <summary>Add or replace clips</summary>
      <Stack gap="sm" mt="xs">
        <Text size="sm">
          A clip takes the place of the one with the same levels and exemplar. Clips of a level that is not declared yet: add the level in
          the builder, leave it unsaved there, and come back: both are saved together.
          {kept !== null && " The unsaved work of the builder will be saved with them."}
        </Text>
        <FileInput
          label="Clips"
          description="MP4 files with H.264, or a zip of them."
          accept=".zip,.mp4,.m4v,.mov"
          multiple
          onChange={(files) => files.length > 0 && send.mutate(files)}
          maw={500}
        />
        {upload !== null && (
          <Group align="end">
            {!upload.has_manifest && (
              <TextInput
                label="Pattern"
                description={`${upload.files.length} clips received. Names of factors in braces.`}
                value={pattern}
                onChange={(event) => setPattern(event.currentTarget.value)}
                w={340}
              />
            )}
            <Button loading={save.isPending || send.isPending} disabled={detail === undefined} onClick={() => save.mutate(undefined)}>
              Save as a new version
            </Button>
          </Group>
        )}
      </Stack>
    </details>
  );
}
