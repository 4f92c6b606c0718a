import { Card, Text, Title, List, Button, NavLink, Select, SimpleGrid, Stack, Switch, TextInput, Anchor } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap, studyQuery } from "../api";
import { Answer, onDemand } from "../ui/Answer";
import { counted, when } from "../ui/format";
import { useState } from "react";
import { useChange } from "../ui/useChange";
import { faultOf, type Typed, WholeNumber } from "../ui/WholeNumber";
import { Address, addressFor, RECRUITER_NAMES, SigningButton } from "./recruiting";
import { Link, useParams, useSearch } from "@tanstack/react-router";

// How long the study's data of persons are kept, and what the server will erase.

type Preview = Schemas["RetentionPreview"];

const WHAT: Record<Preview["periods"][number]["what"], string> = {
  identifiers: "Identifiers (recruiter IDs, URL parameters, completion codes, labels of personal links)",
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

type Settings = Pick<Schemas["ChangeSettings"], "paused" | "quota" | "recruiter">;

/** Saves one part of the settings; the others stay as they are stored. */
function useSettings({ summary, recruiter }: Schemas["StudyDetail"]) {
  const { name, revision, paused, quota } = summary;
  return useChange(
    (changed: Partial<Settings>) => {
      const body = { revision, paused, quota, recruiter: recruiter as Settings["recruiter"], ...changed };
      return unwrap(api.PUT("/api/admin/studies/{study}/settings", { params: { path: { study: name } }, body }));
    },
    { touches: [["study", name], ["studies"]], done: "Saved." },
  );
}

const QUOTA = { min: 1, optional: true };

function Running({ detail }: { detail: Schemas["StudyDetail"] }) {
  const [paused, setPaused] = useState(detail.summary.paused);
  const [quota, setQuota] = useState<Typed>(detail.summary.quota ?? "");
  const save = useSettings(detail);
  return (
    <Card withBorder>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Running
        </Title>
        <Switch label="Paused: no new participants" checked={paused} onChange={(event) => setPaused(event.currentTarget.checked)} />
        <WholeNumber
          label="Close after this many complete runs"
          placeholder="no limit"
          {...QUOTA}
          value={quota}
          onChange={setQuota}
          w={280}
        />
        <Button
          onClick={() => save.mutate({ paused, quota: quota === "" ? null : Number(quota) })}
          loading={save.isPending}
          disabled={faultOf(quota, QUOTA) !== null}
        >
          Save
        </Button>
      </Stack>
    </Card>
  );
}

/** Where participants come from: the service, what it needs of the study, and what the study needs of it. */
function Recruitment({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { name } = detail.summary;
  const [kind, setKind] = useState<Kind | null>(KINDS.find((one) => one === detail.recruiter?.["kind"]) ?? null);
  const [texts, setTexts] = useState(() => textsOf(detail.recruiter));
  const save = useSettings(detail);
  const service = kind === null ? "" : (RECRUITER_NAMES[kind] ?? kind);
  return (
    <Card withBorder>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Recruitment
        </Title>
        <Select
          label={kind === null ? "Recruited through" : "1. Recruited through"}
          placeholder="nobody"
          clearable
          data={KINDS.map((value) => ({ value, label: RECRUITER_NAMES[value] ?? value }))}
          value={kind}
          onChange={(word) => setKind(KINDS.find((one) => one === word) ?? null)}
        />
        {kind !== null && <RecruiterFields service={service} texts={texts} onChange={setTexts} />}
        {kind === "prolific" && texts.code_complete === "" && (
          <Text size="sm" c="orange.9">
            Enter the completion code of the Prolific study. Without it participants get a random code that Prolific rejects, and the study
            cannot go live.
          </Text>
        )}
        <Button onClick={() => save.mutate({ recruiter: kind === null ? null : { kind, ...texts } })} loading={save.isPending}>
          Save
        </Button>
        {detail.recruiter !== null && <LinkForRecruiter study={name} recruiter={detail.recruiter} />}
        {detail.recruiter !== null && <SelfTest detail={detail} />}
        {Boolean(detail.recruiter?.["signature_parameter"]) && <SigningButton study={name} />}
      </Stack>
    </Card>
  );
}

/** What is pasted into the recruiter's page: the first general link, with the parameters that the recruiter fills in. */
function LinkForRecruiter({ study, recruiter }: { study: string; recruiter: Record<string, unknown> }) {
  const links = useQuery({
    queryKey: ["links", study, "first"],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/links", { params: { path: { study } } })),
  }).data?.links;
  const link = links?.find((one) => one.kind === "general" && one.recruiter === null);
  const service = RECRUITER_NAMES[String(recruiter["kind"])] ?? String(recruiter["kind"]);
  if (links === undefined) return null;
  return link === undefined ? (
    <Text size="sm">
      3. Create a general link under{" "}
      <Anchor component={Link} to={`/studies/${study}/links`}>
        Links
      </Anchor>
      . What to paste into {service} then appears here.
    </Text>
  ) : (
    <Address label={`3. Paste this link into ${service}`} url={addressFor(link.url, recruiter)} />
  );
}

interface FieldsProps {
  service: string;
  texts: ReturnType<typeof textsOf>;
  onChange: (texts: ReturnType<typeof textsOf>) => void;
}

const [FIRST, ...OTHERS] = Object.keys(FIELDS) as [Field, ...Field[]];

function RecruiterFields({ service, texts, onChange }: FieldsProps) {
  const field = (name: Field, number = "") => (
    <TextInput
      key={name}
      label={`${number}${FIELDS[name][0]}`}
      placeholder={FIELDS[name][1]}
      value={texts[name]}
      onChange={(event) => onChange({ ...texts, [name]: event.currentTarget.value })}
    />
  );
  return (
    <>
      <SimpleGrid cols={{ base: 1, sm: 2 }} w="100%">
        {field(FIRST, "2. ")}
        <TextInput
          label="Redirect URL: completed"
          placeholder={`empty: the default of ${service}`}
          value={texts.redirect_url}
          onChange={(event) => onChange({ ...texts, redirect_url: event.currentTarget.value })}
        />
      </SimpleGrid>
      <details>
        <summary className="small-summary">More: codes and URLs for other endings, signed links</summary>
        <Text size="sm" my="xs">
          In a URL, {"{code}"}, {"{run}"} and the recruiter&rsquo;s URL parameters are filled in.
        </Text>
        <SimpleGrid cols={{ base: 1, sm: 2 }}>{OTHERS.map((name) => field(name))}</SimpleGrid>
      </details>
    </>
  );
}

const SelfTest = onDemand(async () => (await import("./SelfTest")).SelfTest);
const Versions = onDemand(async () => (await import("./CompareVersions")).Versions);
const CompareVersions = onDemand(async () => (await import("./CompareVersions")).CompareVersions);
const PageLanguages = onDemand(async () => (await import("./Preflight")).PageLanguages);
const LifeCycle = onDemand(async () => (await import("./LifeCycle")).LifeCycle);
const Sharing = onDemand(async () => (await import("./Sharing")).Sharing);

const PARTS = [
  ["running", "Running"],
  ["recruitment", "Recruitment"],
  ["languages", "Languages"],
  ["retention", "Data retention"],
  ["sharing", "Sharing"],
  ["versions", "Versions"],
  ["danger", "Copy and archive"],
] as const;
type Part = (typeof PARTS)[number][0];

export function SettingsTab() {
  const { study = "" } = useParams({ strict: false });
  const { part: asked }: { part?: unknown } = useSearch({ strict: false });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {(detail) => {
        const open = PARTS.filter(([part]) => part !== "sharing" || detail.summary.rights.includes("own"));
        const [current] = open.find(([part]) => part === asked) ?? PARTS[0];
        return (
          <div className="builder">
            <nav className="parts" aria-label="Settings">
              {open.map(([part, label]) => (
                <NavLink
                  key={part}
                  renderRoot={(props) => <Link {...props} to="/studies/$study/settings" params={{ study }} search={{ part }} />}
                  label={label}
                  active={part === current}
                />
              ))}
            </nav>
            <Stack key={`${current}${String(detail.summary.revision)}`} className="builder-page">
              <SettingsPart part={current} detail={detail} />
            </Stack>
          </div>
        );
      }}
    </Answer>
  );
}

function SettingsPart({ part, detail }: { part: Part; detail: Schemas["StudyDetail"] }) {
  switch (part) {
    case "running":
      return <Running detail={detail} />;
    case "recruitment":
      return <Recruitment detail={detail} />;
    case "languages":
      return <PageLanguages />;
    case "retention":
      return <RetentionCard study={detail.summary.name} />;
    case "sharing":
      return <Sharing summary={detail.summary} />;
    case "versions":
      return (
        <>
          <Versions detail={detail} />
          <CompareVersions detail={detail} />
        </>
      );
    case "danger":
      return <LifeCycle detail={detail} />;
  }
}
