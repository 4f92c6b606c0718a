/** The checklist before a study goes live: what is wrong, where, and the way there; its clips are tried in this browser. */

import { Badge, Button, Card, Checkbox, Group, Progress, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { reviewed } from "../../i18n/reviewed";
import { SHIPPED } from "../../i18n";
import { clipCheckQuery, launchChecksQuery, type Schemas, studyQuery } from "../api";
import { namedSection } from "../builder/data";
import type { ClipCheck, ClipProgress } from "../clips/examine";
import { Answer, ErrorAlert, Sentence } from "../ui/Answer";
import { DataTable } from "../ui/DataTable";
import { counted, languageName } from "../ui/format";
import { PreviewButton } from "./recruiting";
import { TurnedAway } from "./StatusBadge";

type Finding = Schemas["LaunchCheck"];

interface Props {
  study: string;
  /** Try the clips at once: the study is about to be opened. */
  atOnce?: boolean;
  /** A box to open the study in spite of its clips; only where nothing else blocks. */
  override?: { isOn: boolean; onChange: (isOn: boolean) => void };
}

export function Preflight({ study, atOnce = false, override }: Props) {
  const detail = useQuery(studyQuery(study)).data;
  const checks = useQuery(launchChecksQuery(study));
  const version = detail?.summary.version ?? 0;
  const clips = useQuery({ ...clipCheckQuery(study, version), enabled: atOnce && version > 0 });
  return (
    <Answer of={checks}>
      {(checked) => {
        // The server names missing and undecodable clips itself; the browser's line about the same is left out.
        const ofBrowser = (clips.data?.findings ?? []).filter(({ kind }) => !checked.some((one) => one.kind === kind));
        const findings = [...checked, ...languageFindings(detail?.definition.languages ?? []), ...ofBrowser];
        return (
          <Stack gap="sm" role="group" aria-label="Before it goes live">
            <Text fw={600}>{summaryOf(findings)}</Text>
            <Findings study={study} findings={findings} />
            <ClipsTried study={study} version={version} check={clips} />
            <TurnedAway study={study} design={detail?.design} />
            {override !== undefined && (
              <Checkbox
                label="Set live with these clips anyway. The audit log records it."
                checked={override.isOn}
                onChange={(event) => override.onChange(event.currentTarget.checked)}
              />
            )}
          </Stack>
        );
      }}
    </Answer>
  );
}

/** "2 to fix before it goes live, 5 to check". */
export function summaryOf(findings: readonly Finding[]): string {
  const fix = findings.filter(({ blocks }) => blocks).length;
  const look = findings.length - fix;
  if (findings.length === 0) return "Nothing prevents going live.";
  if (fix === 0) return `${counted(look, "thing")} to check. None of them prevents going live.`;
  return `${String(fix)} to fix before it goes live${look > 0 ? `, ${String(look)} to check` : ""}.`;
}

/** Languages of the study in which the page itself has no words, or words that nobody has read. */
export function languageFindings(languages: readonly string[]): Finding[] {
  const of = (tag: string) => [tag, tag.slice(0, 2)].find((one) => SHIPPED.includes(one));
  const named = (tags: readonly string[]) => tags.map((tag) => languageName(tag)).join(", ");
  const missing = languages.filter((tag) => of(tag) === undefined);
  const unread = languages.filter((tag) => {
    const shipped = of(tag);
    return shipped !== undefined && !(shipped in reviewed);
  });
  const finding = (text: string): Finding => ({ kind: "page_language", blocks: false, text, page: "settings", path: "languages" });
  return [
    ...(missing.length > 0 ? [finding(`Buttons and hints of the participant page are in English for ${named(missing)}.`)] : []),
    ...(unread.length > 0
      ? [
          finding(
            `Buttons and hints in ${named(unread)} have not been reviewed by a native speaker. Have them reviewed before people take part.`,
          ),
        ]
      : []),
  ];
}

/** Checks of the server in the order in which their findings are listed: what spoils answers, people, then the way there. */
const CHECKS: readonly (readonly [kind: string, words: string])[] = [
  ["placeholders", "Texts to fill in"],
  ["completion_code", "Completion code"],
  ["levels_told_apart", "Clips that give their level away"],
  ["doubtful_trial", "Task of a trial"],
  ["clip_size", "Size of clips in small windows"],
  ["contact", "Contact in the consent text"],
  ["time", "Duration in the consent text"],
  ["pay", "Pay"],
  ["flicker", "Flicker in the consent text"],
  ["translations", "Translations"],
  ["page_language", "Language of buttons"],
  ["person_checks", "Checks that a participant is a person"],
  ["recruiter", "Recruiter"],
  ["paused", "Pause"],
  ["quota", "Limit of participants"],
  ["not_tried", "Preview by a person"],
  ["rehearsal", "Rehearsal"],
  ["plan", "Seal of the analysis plan"],
  ["address", "Address of the server"],
  ["backups", "Backups"],
  ["disk", "Disk"],
];

/** The place of a finding: clips, which are not in the list of checks, before all but texts and codes. */
const rankOf = ({ blocks, kind }: Finding) => (blocks ? 0 : 100) + (CHECKS.findIndex(([of]) => of === kind) + 1 || 2.5);

/** Findings, those first that stop the study, and what the server checked without finding anything. */
export function ranked(findings: readonly Finding[]): { fix: Finding[]; look: Finding[]; fine: string[] } {
  const sorted = [...findings].sort((a, b) => rankOf(a) - rankOf(b));
  const kinds = new Set(findings.map(({ kind }) => kind));
  return {
    fix: sorted.filter(({ blocks }) => blocks),
    look: sorted.filter(({ blocks }) => !blocks),
    fine: CHECKS.filter(([kind]) => !kinds.has(kind)).map(([, words]) => words),
  };
}

function Findings({ study, findings }: { study: string; findings: readonly Finding[] }) {
  const { fix, look, fine } = ranked(findings);
  return (
    <>
      <Lines title="Fix first" study={study} findings={fix} />
      <Lines title={fix.length > 0 ? "Then look at" : "Look at"} study={study} findings={look} />
      {fine.length > 0 && (
        <details>
          <summary className="small-summary">Nothing found by {counted(fine.length, "other check")}</summary>
          <Text size="sm">{fine.join("; ")}.</Text>
        </details>
      )}
    </>
  );
}

function Lines({ title, study, findings }: { title: string; study: string; findings: readonly Finding[] }) {
  if (findings.length === 0) return null;
  return (
    <div>
      <Text size="sm" fw={600} mb={4}>
        {title} ({findings.length})
      </Text>
      <ul className="checklist" aria-label={title}>
        {findings.map((finding) => (
          <li key={`${finding.kind} ${finding.text}`}>
            <Badge {...(finding.blocks ? { color: "red.9" } : { variant: "default" })}>{finding.blocks ? "fix" : "check"}</Badge>
            <Text size="sm" component="div" className="wrap-anywhere">
              <Long text={finding.text} /> <Where study={study} finding={finding} />
            </Text>
          </li>
        ))}
      </ul>
    </div>
  );
}

const LONG_TEXT = 400;

/** A finding's sentence; one that names a great many things is shortened until somebody asks for all. */
function Long({ text }: { text: string }) {
  const [isWhole, setWhole] = useState(text.length <= LONG_TEXT);
  if (isWhole) return <Sentence text={text} />;
  return (
    <>
      <Sentence text={`${text.slice(0, text.lastIndexOf(",", LONG_TEXT))}, …`} />{" "}
      <button type="button" className="line-link" onClick={() => setWhole(true)}>
        Show all
      </button>
    </>
  );
}

const PAGES = {
  build: { to: "/studies/$study/build", label: "Build", right: "edit" },
  settings: { to: "/studies/$study/settings", label: "Settings", right: "run" },
  links: { to: "/studies/$study/links", label: "Links", right: "run" },
  data: { to: "/studies/$study/data", label: "Data", right: "export" },
  clips: { to: "/studies/$study/clips", label: "Clips", right: "view" },
  rehearsal: { to: "/studies/$study/rehearsal", label: "Rehearsal", right: "view" },
} as const;

/** The way to where a finding is fixed; nothing where that is not a page of the study, or not open to this account. */
function Where({ study, finding: { page, path } }: { study: string; finding: Finding }) {
  const rights = useQuery(studyQuery(study)).data?.summary.rights ?? [];
  if (page === "preview" && rights.includes("run")) return <PreviewButton study={study} small />;
  if (page === "preview" || page === "server") return null;
  const { to, label, right } = PAGES[page];
  if (!rights.includes(right)) return null;
  const section = page === "build" ? namedSection(path ?? "") : undefined;
  return (
    <Link to={to} params={{ study }} search={section !== undefined ? { section: section.id } : page === "settings" ? { part: path } : {}}>
      {section === undefined ? label : `${label}, ${section.label}`}
    </Link>
  );
}

interface ClipsTriedProps {
  study: string;
  version: number;
  check: { data: ClipCheck | undefined; error: Error | null; isFetching: boolean; refetch: () => unknown };
}

/** The state of the clips' trial: begun by a button here, at once where the study is about to be opened. */
function ClipsTried({ study, version, check }: ClipsTriedProps) {
  const progress = useQuery<ClipProgress>({
    queryKey: [...clipCheckQuery(study, version).queryKey, "progress"],
    queryFn: () => ({ done: 0, of: 0 }),
    enabled: false,
  }).data;
  if (check.isFetching) {
    const { done, of } = progress ?? { done: 0, of: 0 };
    return (
      <Stack gap={4} role="status" aria-label="Clips">
        <Group justify="space-between">
          <Text size="sm" className="number">
            Trying the clips in this browser: {done} of {of}
          </Text>
          <Button
            size="compact-xs"
            variant="default"
            onClick={() => void import("../clips/examine").then(({ skipRest }) => skipRest(study))}
          >
            Skip the rest
          </Button>
        </Group>
        <Progress value={of === 0 ? 0 : (100 * done) / of} aria-label="Clips tried" />
      </Stack>
    );
  }
  if (check.error !== null) return <ErrorAlert error={check.error} retry={() => void check.refetch()} />;
  const button = (label: string) => (
    <Button size="compact-sm" variant="default" onClick={() => void check.refetch()}>
      {label}
    </Button>
  );
  const { data } = check;
  if (data === undefined) {
    return (
      <Group gap="xs">
        {button("Try the clips")}
        <Text size="sm" c="dimmed">
          Each clip is decoded in this browser, as for participants.
        </Text>
      </Group>
    );
  }
  if (!data.canTell) return null;
  return (
    <Group gap="xs" role="status" aria-label="Clips">
      <Text size="sm">
        {data.done === data.of ? "All clips were tried. " : `${String(data.done)} of ${String(data.of)} clips were tried. `}
        {data.facts}.
      </Text>
      {data.done < data.of && button("Try all clips")}
    </Group>
  );
}

/** Languages in which the participants' page itself speaks, and whether a person has read what it says. */
export function PageLanguages() {
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
