/** Whether people may begin, how many, where they come from and where they go at the end. */

import { Button, Card, Group, NumberInput, Select, SimpleGrid, Stack, Switch, Text, TextInput, Title } from "@mantine/core";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";
import { SigningButton } from "./SigningButton";

type Kind = NonNullable<Schemas["Recruiter"]["kind"]>;
const KINDS: Kind[] = ["prolific", "sona", "mturk", "generic"];

const FIELDS = {
  code_complete: ["Completion code", "empty: a different one for each run"],
  code_screened_out: ["Code where screened out", "empty: none is shown"],
  code_failed_check: ["Code where checks failed", "empty: the completion code"],
  redirect_screened_out: ["Address for who is screened out", "empty: none, on Prolific by the code"],
  redirect_declined: ["Address for who takes no part", "empty: none, on Prolific its start page"],
  id_parameter: ["Address parameter of their id", "empty: the recruiter's usual one"],
  signature_parameter: ["Address parameter of its signature", "empty: addresses are not signed"],
  secret_name: ["Name of the signing secret", "another name makes another secret"],
} as const;
type Field = keyof typeof FIELDS;

function textsOf(recruiter: Record<string, unknown> | null): Record<Field | "redirect_url", string> {
  const text = (name: string) => {
    const value = recruiter?.[name];
    return typeof value === "string" ? value : "";
  };
  return {
    code_complete: text("code_complete"),
    code_screened_out: text("code_screened_out"),
    redirect_screened_out: text("redirect_screened_out"),
    redirect_declined: text("redirect_declined"),
    code_failed_check: text("code_failed_check"),
    id_parameter: text("id_parameter"),
    signature_parameter: text("signature_parameter"),
    secret_name: text("secret_name"),
    redirect_url: text("redirect_url"),
  };
}

export function Running({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { name, revision } = detail.summary;
  const [paused, setPaused] = useState(detail.summary.paused);
  const [quota, setQuota] = useState<number | string>(detail.summary.quota ?? "");
  const [kind, setKind] = useState<Kind | null>(KINDS.find((one) => one === detail.recruiter?.["kind"]) ?? null);
  const [texts, setTexts] = useState(() => textsOf(detail.recruiter));
  const save = useChange(
    () => {
      const recruiter = kind === null ? null : { kind, ...texts };
      const body = { revision, paused, quota: quota === "" ? null : Number(quota), recruiter };
      return unwrap(api.PUT("/api/admin/studies/{study}/settings", { params: { path: { study: name } }, body }));
    },
    { touches: [["study", name], ["studies"]], done: "Saved." },
  );
  return (
    <Card withBorder>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Running
        </Title>
        <Switch label="Paused: nobody can begin" checked={paused} onChange={(event) => setPaused(event.currentTarget.checked)} />
        <Group align="end">
          <NumberInput label="Close at this many complete runs" placeholder="no limit" min={1} value={quota} onChange={setQuota} w={280} />
          <Select
            label="Recruited through"
            placeholder="nobody"
            clearable
            data={KINDS}
            value={kind}
            onChange={(word) => setKind(KINDS.find((one) => one === word) ?? null)}
          />
        </Group>
        {kind !== null && <RecruiterFields texts={texts} onChange={setTexts} />}
        {Boolean(detail.recruiter?.["signature_parameter"]) && <SigningButton study={name} />}
        {kind === "prolific" && texts.code_complete === "" && (
          <Text size="sm" c="orange.9">
            Enter the completion code of the Prolific study: without it participants get a random code, which Prolific does not accept, and
            the study cannot go live.
          </Text>
        )}
        <Button onClick={() => save.mutate(undefined)} loading={save.isPending}>
          Save
        </Button>
      </Stack>
    </Card>
  );
}

interface FieldsProps {
  texts: ReturnType<typeof textsOf>;
  onChange: (texts: ReturnType<typeof textsOf>) => void;
}

function RecruiterFields({ texts, onChange }: FieldsProps) {
  return (
    <>
      <SimpleGrid cols={{ base: 1, sm: 2 }} w="100%">
        {(Object.keys(FIELDS) as Field[]).map((field) => (
          <TextInput
            key={field}
            label={FIELDS[field][0]}
            placeholder={FIELDS[field][1]}
            value={texts[field]}
            onChange={(event) => onChange({ ...texts, [field]: event.currentTarget.value })}
          />
        ))}
      </SimpleGrid>
      <TextInput
        w="100%"
        label="Address to go to at the end"
        description="{code}, {run} and the parameters of the recruiter's address are filled in. Empty: the recruiter's usual one."
        value={texts.redirect_url}
        onChange={(event) => onChange({ ...texts, redirect_url: event.currentTarget.value })}
      />
    </>
  );
}
