import { Alert, Stack, Tabs, TextInput, Title } from "@mantine/core";
import { useRef, useState } from "react";
import { FromDefinition } from "./FromDefinition";
import { FromOwnClips } from "./FromOwnClips";
import { useOwnWorkspaces } from "../queries";
import { FromShipped } from "./FromShipped";

export function CreatePage() {
  const mayCreate = useOwnWorkspaces().length > 0;
  return mayCreate ? <NewStudy /> : <NoWorkspace />;
}

function NoWorkspace() {
  return (
    <Alert color="yellow" title="You cannot create studies yet">
      Creating a study needs the role experimenter or owner in a workspace. Ask an owner of a workspace.
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
        description="Letters, digits, - and _: it names the study in addresses and files."
        ref={field}
        value={name}
        error={wrong ? "Expected letters, digits, - and _ only, at most 60." : taken}
        onChange={(event) => {
          setName(event.currentTarget.value);
          setTaken(null);
        }}
        maw={400}
      />
      <Tabs defaultValue="shipped">
        <Tabs.List>
          <Tabs.Tab value="shipped">From a shipped experiment</Tabs.Tab>
          <Tabs.Tab value="clips">From your own clips</Tabs.Tab>
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
