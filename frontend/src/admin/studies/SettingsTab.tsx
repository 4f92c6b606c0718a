import {
  Badge,
  Card,
  Text,
  Title,
  List,
  Button,
  Group,
  NumberInput,
  Select,
  SimpleGrid,
  Stack,
  Switch,
  TextInput,
  Anchor,
} from "@mantine/core";
import { languageName, SHIPPED } from "../../i18n";
import { reviewed } from "../../i18n/reviewed";
import { DataTable } from "../ui/DataTable";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap, studyQuery } from "../api";
import { Answer, onDemand } from "../ui/Answer";
import { counted, when } from "../ui/format";
import { useState } from "react";
import { useChange } from "../ui/useChange";
import { SigningButton } from "./recruiting";
import { useParams } from "@tanstack/react-router";

/** Languages in which the participants' page itself speaks, and whether a person has read what it says. */
function PageLanguages() {
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="xs">
        The page&rsquo;s own words
      </Title>
      <Text size="sm" mb="sm">
        Buttons, hints and errors of the participant page; other languages use English. Have an unreviewed language checked before people
        take part in it.
      </Text>
      <DataTable
        label="Languages of the page"
        rows={SHIPPED}
        rowKey={(tag) => tag}
        empty="None."
        columns={[
          { title: "Language", cell: (tag) => <span lang={tag}>{languageName(tag)}</span> },
          { title: "Tag", cell: (tag) => <code>{tag}</code> },
          {
            title: "Read by",
            cell: (tag) => {
              const by = reviewed[tag];
              return by ? `${by.by}, ${by.on}` : <Badge variant="default">unreviewed</Badge>;
            },
          },
        ]}
      />
    </Card>
  );
}

// How long the study's data of persons are kept, and what the server will erase.

type Preview = Schemas["RetentionPreview"];

const WHAT: Record<Preview["periods"][number]["what"], string> = {
  identifiers: "Identifiers (recruiter ids, URL parameters, completion codes, labels of personal links)",
  unfinished: "Incomplete visits with their answers",
  answers: "All visits with their answers",
};

function RetentionCard({ study }: { study: string }) {
  const preview = useQuery({
    queryKey: ["study", study, "retention"],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/retention", { params: { path: { study } } })),
  });
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        How long data are kept
      </Title>
      <Answer of={preview}>{(data) => (data.periods.length > 0 ? <Declared preview={data} /> : <Undeclared preview={data} />)}</Answer>
    </Card>
  );
}

function Declared({ preview }: { preview: Preview }) {
  return (
    <>
      <List size="sm" mb="sm">
        {preview.periods.map(({ what, days }) => (
          <List.Item key={what}>
            {WHAT[what]}: {days} {days === 1 ? "day" : "days"} after the last sign of life
          </List.Item>
        ))}
      </List>
      <Coming preview={preview} />
    </>
  );
}

function Undeclared({ preview }: { preview: Preview }) {
  return (
    <>
      <Text size="sm">
        No period is declared: data stay until someone erases them. Declare one in the builder under “Retention and sharing”.
      </Text>
      <Coming preview={preview} />
    </>
  );
}

function Coming({ preview }: { preview: Preview }) {
  const due = preview.identifiers + preview.visits;
  if (due === 0 && preview.next_at === null) return null;
  return (
    <Text size="sm" mt="xs">
      {due > 0 &&
        `Within the hour the server erases ${counted(preview.visits, "visit")}, and the identifiers of ${String(preview.identifiers)} more. `}
      {preview.next_at !== null && `The next is due ${when(preview.next_at)}.`}
    </Text>
  );
}

// Whether people may begin, how many, where they come from and where they go at the end.

type Kind = NonNullable<Schemas["Recruiter"]["kind"]>;
const KINDS: Kind[] = ["prolific", "sona", "mturk", "generic"];

const FIELDS = {
  code_complete: ["Completion code", "empty: a different code for each run"],
  code_screened_out: ["Code: screened out", "empty: no code"],
  code_failed_check: ["Code: failed checks", "empty: the completion code"],
  redirect_screened_out: ["Redirect URL: screened out", "empty: none (on Prolific the code is enough)"],
  redirect_declined: ["Redirect URL: declined consent", "empty: none (on Prolific: its start page)"],
  id_parameter: ["URL parameter of the participant id", "empty: the recruiter's default"],
  signature_parameter: ["URL parameter of the signature", "empty: URLs are not signed"],
  secret_name: ["Name of the signing secret", "a new name creates a new secret"],
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

function Running({ detail }: { detail: Schemas["StudyDetail"] }) {
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
        <Switch label="Paused: no new participants" checked={paused} onChange={(event) => setPaused(event.currentTarget.checked)} />
        <Group align="end">
          <NumberInput
            label="Close after this many complete runs"
            placeholder="no limit"
            min={1}
            value={quota}
            onChange={setQuota}
            w={280}
          />
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
            Enter the completion code of the Prolific study. Without it participants get a random code that Prolific rejects, and the study
            cannot go live.
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
        label="Redirect URL: completed"
        description="{code}, {run} and the recruiter's URL parameters are filled in. Empty: the recruiter's default."
        value={texts.redirect_url}
        onChange={(event) => onChange({ ...texts, redirect_url: event.currentTarget.value })}
      />
    </>
  );
}

const CompareVersions = onDemand(async () => (await import("./CompareVersions")).CompareVersions);
const LifeCycle = onDemand(async () => (await import("./LifeCycle")).LifeCycle);
const Sharing = onDemand(async () => (await import("./Sharing")).Sharing);

export function SettingsTab() {
  const { study = "" } = useParams({ strict: false });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {(detail) => (
        <Stack key={detail.summary.revision} maw={900}>
          <Running detail={detail} />
          <Versions detail={detail} />
          <CompareVersions detail={detail} />
          <RetentionCard study={detail.summary.name} />
          <PageLanguages />
          {detail.summary.rights.includes("own") && <Sharing summary={detail.summary} />}
          <LifeCycle detail={detail} />
        </Stack>
      )}
    </Answer>
  );
}

type Version = Schemas["StudyDetail"]["versions"][number];

function Versions({ detail }: { detail: Schemas["StudyDetail"] }) {
  const address = (version: Version) => `/api/admin/studies/${detail.summary.name}/versions/${version.number}`;
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Versions
      </Title>
      <DataTable
        rows={detail.versions}
        rowKey={(version) => version.number}
        empty="None."
        columns={[
          {
            title: "Version",
            number: true,
            cell: (version) => (
              <Anchor href={address(version)} target="_blank" rel="noopener">
                {version.number}
              </Anchor>
            ),
          },
          { title: "Made", cell: (version) => when(version.created_at) },
          { title: "Runs", number: true, cell: (version) => version.runs },
          { title: "Note", wrap: true, cell: (version) => version.note },
          { title: "SHA-256", wide: true, cell: (version) => <code>{version.definition_sha256.slice(0, 12)}</code> },
        ]}
      />
    </Card>
  );
}
