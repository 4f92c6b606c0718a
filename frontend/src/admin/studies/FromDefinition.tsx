import { Button, FileInput, Select, Stack, Text, TextInput } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";
import { DefinitionEditor, useCheck } from "./DefinitionEditor";
import { uploadFiles, useCreate } from "./useCreate";

export function FromDefinition({ name }: { name: string }) {
  const [toml, setToml] = useState("");
  const [upload, setUpload] = useState<Schemas["UploadOut"] | null>(null);
  const [shipped, setShipped] = useState<string | null>(null);
  const experiments = useQuery({ queryKey: ["experiments"], queryFn: () => unwrap(api.GET("/api/admin/experiments")) });
  const send = useChange(uploadFiles, { touches: [], then: setUpload });
  const create = useCreate();
  const [pattern, setPattern] = useState("");
  const levels = upload?.has_manifest === true ? null : { pattern };
  const usable = useCheck(toml)?.design != null;
  return (
    <Stack>
      <Select
        label="Begin with"
        placeholder="an empty page"
        clearable
        data={experiments.data?.map(({ name: value, title }) => ({ value, label: title })) ?? []}
        value={shipped}
        onChange={(chosen) => {
          setShipped(chosen);
          const found = experiments.data?.find((experiment) => experiment.name === chosen);
          if (found !== undefined) setToml(found.toml);
        }}
        maw={400}
      />
      <DefinitionEditor toml={toml} onChange={setToml} />
      <FileInput
        label="Clips built for it"
        description="A zip of the folder that `stimuli build` or `stimuli manifest` wrote, or of clips alone. Not needed where the clips of the experiment chosen above fit."
        accept=".zip"
        clearable
        onChange={(file) => file !== null && send.mutate([file])}
        maw={500}
      />
      {upload !== null && <Text size="sm">{upload.files.length} clips received.</Text>}
      {upload !== null && !upload.has_manifest && (
        <TextInput
          label="Pattern of the file names"
          description="The zip holds no manifest.json, so the names say which levels each clip has."
          placeholder="{character}_{speed}_{exemplar}.mp4"
          value={pattern}
          onChange={(event) => setPattern(event.currentTarget.value)}
          maw={500}
        />
      )}
      {name === "" && <Text size="sm">Give the study a short name above.</Text>}
      <Button
        style={{ alignSelf: "flex-start" }}
        disabled={name === "" || !usable || (upload === null && shipped === null)}
        loading={create.isPending || send.isPending}
        onClick={() => create.mutate(upload === null ? { name, toml, shipped } : { name, toml, upload: upload.id, levels })}
      >
        Create
      </Button>
    </Stack>
  );
}
