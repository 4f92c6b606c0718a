/** The pages a participant reads: written on the left, as they will look on the right. */

import { Alert, Button, Group, Paper, Select, SimpleGrid, Stack, Textarea } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useEffect, useRef, useState } from "react";
import { markdown } from "../../ui/markdown";
import { api, type Schemas, unwrap } from "../api";
import { studyQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { languageName } from "../ui/format";
import { useChange } from "../ui/useChange";
import { useUnsaved } from "../ui/useUnsaved";

type Page = Exclude<keyof Schemas["Texts"], "screened_out">;
const PAGES: [page: Page, label: string][] = [
  ["consent", "Consent"],
  ["instructions", "Instructions"],
  ["practice", "Practice"],
  ["block_break", "Break"],
  ["debrief", "Debrief"],
];

export function TextsTab() {
  const { study = "" } = useParams({ strict: false });
  return <Answer of={useQuery(studyQuery(study))}>{(detail) => <Texts key={detail.summary.revision} detail={detail} />}</Answer>;
}

function Texts({ detail }: { detail: Schemas["StudyDetail"] }) {
  const languages = detail.definition.languages;
  const [language, setLanguage] = useState(languages[0] ?? "en");
  const [edits, setEdits] = useState<Partial<Record<Page, string>>>({});
  const mayChange = useMay("experimenter");
  const { name, revision, status } = detail.summary;
  const present = detail.definition.texts[language];
  const textOf = (page: Page): string => present?.[page] ?? "";
  const changed = PAGES.some(([page]) => edits[page] !== undefined && edits[page] !== textOf(page));
  useUnsaved(changed);
  const save = useChange(
    () =>
      unwrap(
        api.PUT("/api/admin/studies/{study}/texts", { params: { path: { study: name } }, body: { revision, language, texts: edits } }),
      ),
    { touches: [["study", name]], done: "Saved as a new version." },
  );
  return (
    <Stack>
      {status === "live" && mayChange && (
        <Alert color="yellow">This study is live. A change makes a new version; runs under way keep theirs.</Alert>
      )}
      <Group align="end" justify="space-between">
        <Select
          label="Language"
          description={changed ? "Save or undo before you change it." : undefined}
          data={languages.map((code) => ({ value: code, label: languageName(code) }))}
          value={language}
          allowDeselect={false}
          disabled={changed}
          onChange={(chosen) => setLanguage(chosen ?? language)}
        />
        {mayChange && (
          <Group gap="xs">
            <Button variant="default" disabled={!changed} onClick={() => setEdits({})}>
              Undo changes
            </Button>
            <Button disabled={!changed} loading={save.isPending} onClick={() => save.mutate(undefined)}>
              Save
            </Button>
          </Group>
        )}
      </Group>
      {PAGES.map(([page, label]) => (
        <OnePage
          key={page}
          label={label}
          text={edits[page] ?? textOf(page)}
          onChange={mayChange ? (text) => setEdits({ ...edits, [page]: text }) : null}
        />
      ))}
    </Stack>
  );
}

interface PageProps {
  label: string;
  text: string;
  onChange: ((text: string) => void) | null;
}

function OnePage({ label, text, onChange }: PageProps) {
  return (
    <SimpleGrid cols={{ base: 1, md: 2 }} spacing="sm">
      <Textarea
        label={`${label} (Markdown)`}
        autosize
        minRows={3}
        maxRows={20}
        readOnly={onChange === null}
        value={text}
        onChange={(event) => onChange?.(event.currentTarget.value)}
      />
      <Paper withBorder p="sm" mt={{ base: 0, md: 25 }} role="group" aria-label={`${label}, as participants see it`}>
        <Shown text={text} />
      </Paper>
    </SimpleGrid>
  );
}

function Shown({ text }: { text: string }) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const parts = markdown(text === "" ? "*No text.*" : text);
    // Inside this page they are no headings of it.
    for (const part of parts) if (/^H\d$/.test(part.tagName)) part.setAttribute("role", "presentation");
    place.current?.replaceChildren(...parts);
  }, [text]);
  return <div className="prose" ref={place} />;
}
