/** A new study: from a shipped one, from a definition, or from the user's own clips. */

import { useDebouncedValue } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap, Refused, studiesQuery, useOwnWorkspaces } from "../api";
import { Design, TomlText } from "./Design";
import { useNavigate, Link } from "@tanstack/react-router";
import { useChange } from "../ui/useChange";
import { Button, Select, Stack, TextInput, Alert, Text, Anchor, Card, Progress, Group, SimpleGrid, Title, Tabs } from "@mantine/core";
import { type ComponentProps, useState, useRef } from "react";
import { UploadClips, StillNeeded } from "../clips/UploadClips";
import { playNeeded, useUpload } from "../clips/useUpload";
import { Answer, onDemand } from "../ui/Answer";
import type { Asked } from "./Levels";
import { TemplateCards, TEMPLATES } from "./templates";

// TOML with its problems, checked while typing, and what it expands to.

interface Props {
  toml: string;
  onChange: (toml: string) => void;
}

function DefinitionEditor({ toml, onChange }: Props) {
  const checked = useCheck(toml);
  return (
    <>
      <TomlText toml={toml} onChange={onChange} problems={checked?.problems ?? []} />
      {checked?.design !== null && checked?.design !== undefined && <Design design={checked.design} />}
    </>
  );
}

/** What the server says of a definition, half a second after the last key. */
function useCheck(toml: string): Schemas["DefinitionCheck"] | undefined {
  const [settled] = useDebouncedValue(toml, 500);
  const { data } = useQuery({
    queryKey: ["check", settled],
    queryFn: () => unwrap(api.POST("/api/admin/definitions/check", { body: { toml: settled } })),
    enabled: settled.trim() !== "",
    placeholderData: (before) => before,
  });
  return settled.trim() === "" ? undefined : data;
}

const isTaken = (error: Error | null) => error instanceof Refused && error.code === "name_taken";

/** Why no study was made, but for its name; null where that is not so. */
const refusal = (error: Error | null): string | null => (error === null || isTaken(error) ? null : error.message);

/**
 * Create a study and open it; `taken` gets the message if another study has the name.
 * @param isShown whether the page itself shows every other refusal
 */
function useCreate(taken: (message: string) => void, created?: () => void, isShown = false) {
  const navigate = useNavigate();
  return useChange((body: Schemas["NewStudy"]) => unwrap(api.POST("/api/admin/studies", { body })), {
    touches: [["studies"]],
    done: "Study created as a draft.",
    refused: (error) => {
      if (!isTaken(error)) return isShown;
      taken(error.message);
      return true;
    },
    then: ({ summary }) => {
      created?.();
      void navigate({ to: `/studies/${summary.name}` });
    },
  });
}

function FromDefinition({ name, onTaken }: { name: string; onTaken: (message: string) => void }) {
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
            A zip file of the folder that <code>stimuli build</code> or <code>stimuli manifest</code> wrote, or of clips alone. Not needed
            where the clips of the experiment chosen above fit.
          </>
        }
        accept=".zip"
      />
      {upload !== null && !upload.has_manifest && (
        <TextInput
          label="Pattern of the file names"
          description="The zip contains no manifest.json, so the levels of each clip are read from the file names."
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

// A study from somebody's own clips: upload, say which levels each has, ask a question.

const Levels = onDemand(async () => (await import("./Levels")).Levels);

function FromOwnClips({ name, onTaken }: { name: string; onTaken: (message: string) => void }) {
  const upload = useUpload("new study");
  const { last, received } = upload;
  const [template, setTemplate] = useState(TEMPLATES[0]);
  // What was written about the study stays where the upload starts over.
  const [asked, setAsked] = useState<Asked>({ title: "", question: null, low: "very unnatural", high: "very natural" });
  return (
    <Stack>
      <UploadClips upload={upload} />
      <TemplateCards chosen={template} onChoose={setTemplate} />
      {last !== null && (
        <StudyOfUpload
          key={last.id}
          name={name}
          template={template}
          asked={asked}
          onAsk={setAsked}
          upload={last}
          isLooked={received !== null}
          notPlayed={playNeeded(upload)}
          onTaken={onTaken}
          onCreated={upload.forget}
        />
      )}
    </Stack>
  );
}

interface OfUpload extends Omit<ComponentProps<typeof Levels>, "refused" | "isCreating" | "onCreate"> {
  onTaken: (message: string) => void;
  onCreated: () => void;
}

function StudyOfUpload({ onTaken, onCreated, ...rest }: OfUpload) {
  const create = useCreate(onTaken, onCreated, true);
  return <Levels {...rest} refused={refusal(create.error)} isCreating={create.isPending} onCreate={(study) => create.mutate(study)} />;
}

const buildsQuery = { queryKey: ["clip builds"], queryFn: () => unwrap(api.GET("/api/admin/experiments/builds")) };
type Build = Schemas["ClipBuild"];

const isUnderWay = (build: Build | undefined) => build?.status === "queued" || build?.status === "running";

function FromShipped({ name, onTaken }: { name: string; onTaken: (message: string) => void }) {
  const builds = useQuery({
    ...buildsQuery,
    refetchInterval: ({ state }) => (state.data?.builds.some(isUnderWay) === true ? 1_000 : false),
  }).data;
  const busy = builds?.builds.some(isUnderWay) ?? false;
  // Which experiments have clips is asked again when a build has ended.
  const done = builds?.builds.filter(({ status }) => status === "done").length ?? 0;
  const shipped = useQuery({ queryKey: ["experiments", done], queryFn: () => unwrap(api.GET("/api/admin/experiments")) });
  const create = useCreate(onTaken);
  const present = new Set(useQuery(studiesQuery).data?.map((study) => study.name));
  const card = (experiment: Shipped) => (
    <Card withBorder key={experiment.name}>
      <Title order={3} size="h5">
        {experiment.title}
      </Title>
      <Text size="sm" c="dimmed" mb="md">
        {experiment.name}
      </Text>
      {name === "" && present.has(experiment.name) ? (
        <Text size="sm" mt="auto">
          It is{" "}
          <Anchor component={Link} to={`/studies/${experiment.name}`} underline="always">
            there already
          </Anchor>
          . To create another one, enter a short name above.
        </Text>
      ) : experiment.clips_ready ? (
        <Group mt="auto">
          <Button
            loading={create.isPending && create.variables.shipped === experiment.name}
            onClick={() => create.mutate({ name: name || experiment.name, shipped: experiment.name })}
          >
            Create “{name || experiment.name}”
          </Button>
        </Group>
      ) : (
        <BuildClips
          experiment={experiment.name}
          lacks={builds?.lacks ?? ""}
          busy={busy}
          build={builds?.builds.find((one) => one.experiment === experiment.name)}
        />
      )}
    </Card>
  );
  return (
    <Answer of={shipped}>
      {(experiments) => (
        <Stack>
          <Text size="sm">You can change texts and settings later. Clips are built on the server; you can leave this page meanwhile.</Text>
          {[
            { title: "Experiments of the paper", isDemo: false },
            { title: "Demonstrations", isDemo: true },
          ].map(({ title, isDemo }) => (
            <Stack key={title} gap="xs">
              <Title order={2} size="h4">
                {title}
              </Title>
              <SimpleGrid cols={{ base: 1, sm: 3 }}>
                {experiments.filter(({ demonstration }) => demonstration === isDemo).map((one) => card(one))}
              </SimpleGrid>
            </Stack>
          ))}
        </Stack>
      )}
    </Answer>
  );
}

type Shipped = Schemas["ShippedExperiment"];

interface BuildProps {
  experiment: string;
  /** Why this server cannot build; empty where it can. */
  lacks: string;
  /** Whether the clips of any experiment are being built. */
  busy: boolean;
  build: Build | undefined;
}

/** A button that has the server build the clips, how far it is, and why it failed. */
function BuildClips({ experiment, lacks, busy, build }: BuildProps) {
  const begin = useChange(() => unwrap(api.POST("/api/admin/experiments/{experiment}/builds", { params: { path: { experiment } } })), {
    touches: [buildsQuery.queryKey],
  });
  if (build !== undefined && isUnderWay(build))
    return (
      <Stack gap={4} mt="auto" role="status">
        <Text size="sm" className="number">
          Building its clips: {build.message}
        </Text>
        <Progress value={100 * build.progress} animated aria-label={`Clips of ${experiment} built`} />
      </Stack>
    );
  return (
    <Stack gap={4} mt="auto" align="start">
      {build?.status === "failed" && (
        <Text size="sm" c="var(--mantine-color-error)" className="wrap-anywhere">
          The clips were not built: {build.message}
        </Text>
      )}
      <Button
        variant="default"
        disabled={lacks !== "" || busy}
        loading={begin.isPending}
        onClick={() => begin.mutate(undefined)}
        aria-label={`Build its clips: ${experiment}`}
      >
        Build its clips
      </Button>
      {lacks !== "" && <Text size="sm">{lacks}</Text>}
    </Stack>
  );
}

export function CreatePage() {
  const mayCreate = useOwnWorkspaces().length > 0;
  return mayCreate ? <NewStudy /> : <NoWorkspace />;
}

function NoWorkspace() {
  return (
    <Alert color="yellow" title="You cannot create studies yet">
      To create a study you need the role experimenter or owner in a workspace. Ask an owner of a workspace.
    </Alert>
  );
}

function NewStudy() {
  const [name, setName] = useState("");
  const [taken, setTaken] = useState<string | null>(null);
  const field = useRef<HTMLInputElement>(null);
  const wrong = name !== "" && !/^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$/.test(name);
  const given = {
    name: wrong ? "" : name,
    onTaken: (message: string) => {
      setTaken(message);
      field.current?.focus();
    },
  };
  return (
    <Stack maw={900}>
      <Title order={1}>New study</Title>
      <TextInput
        label="Short name"
        description="Letters, digits, - and _. Used in URLs and file names."
        ref={field}
        value={name}
        error={wrong ? "Expected letters, digits, - and _ only, at most 60." : taken}
        onChange={(event) => {
          setName(event.currentTarget.value);
          setTaken(null);
        }}
        maw={400}
      />
      <Tabs defaultValue="clips">
        <Tabs.List>
          <Tabs.Tab value="clips">From your own clips</Tabs.Tab>
          <Tabs.Tab value="shipped">From a shipped experiment</Tabs.Tab>
          <Tabs.Tab value="definition">From a definition (TOML)</Tabs.Tab>
        </Tabs.List>
        <Tabs.Panel value="shipped" pt="md">
          <FromShipped {...given} />
        </Tabs.Panel>
        <Tabs.Panel value="clips" pt="md">
          <FromOwnClips {...given} />
        </Tabs.Panel>
        <Tabs.Panel value="definition" pt="md">
          <FromDefinition {...given} />
        </Tabs.Panel>
      </Tabs>
    </Stack>
  );
}
