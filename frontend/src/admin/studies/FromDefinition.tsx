import { Button, Select, Stack, TextInput } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, unwrap } from "../api";
import { UploadClips } from "../clips/UploadClips";
import { playNeeded, useUpload } from "../clips/useUpload";
import { DefinitionEditor, useCheck } from "./DefinitionEditor";
import { StillNeeded } from "./StillNeeded";
import { useCreate } from "./useCreate";

export function FromDefinition({ name, onTaken }: { name: string; onTaken: (message: string) => void }) {
  const [toml, setToml] = useState("");
  const sent = useUpload("new definition");
  const upload = sent.received;
  const [shipped, setShipped] = useState<string | null>(null);
  const experiments = useQuery({ queryKey: ["experiments"], queryFn: () => unwrap(api.GET("/api/admin/experiments")) });
  const create = useCreate(onTaken, sent.forget);
  const [pattern, setPattern] = useState("");
  const levels = upload?.has_manifest === true ? null : { pattern };
  const hasClips = experiments.data?.some(({ name: value, clips_ready }) => value === shipped && clips_ready) === true;
  const usable = useCheck(toml)?.design != null;
  const needed = [
    name === "" && "a short name (above)",
    !usable && "a definition without problems",
    playNeeded(sent),
    upload === null && !hasClips && "clips built for it, or a shipped experiment whose clips are built to begin with",
  ];
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
          const definition = experiments.data?.find((experiment) => experiment.name === chosen);
          if (definition !== undefined) setToml(definition.toml);
        }}
        maw={400}
      />
      <DefinitionEditor toml={toml} onChange={setToml} />
      <UploadClips
        upload={sent}
        label="Clips built for it"
        description={
          <>
            A zip of the folder that <code>stimuli build</code> or <code>stimuli manifest</code> wrote, or of clips alone. Not needed where
            the clips of the experiment chosen above fit.
          </>
        }
        accept=".zip"
      />
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
      <StillNeeded parts={needed} />
      <Button
        style={{ alignSelf: "flex-start" }}
        disabled={needed.some(Boolean)}
        loading={create.isPending || sent.sending !== null || (sent.progress?.waiting ?? 0) > 0}
        onClick={() => create.mutate(upload === null ? { name, toml, shipped } : { name, toml, upload: upload.id, levels })}
      >
        Create
      </Button>
    </Stack>
  );
}
