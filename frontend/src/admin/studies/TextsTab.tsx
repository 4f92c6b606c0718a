import { Alert, Button, Group, Select, Stack, Textarea } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { studyQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { useChange } from "../ui/useChange";

const PAGES = { consent: "Consent", instructions: "Instructions", practice: "Practice", block_break: "Break", debrief: "Debrief" };

export function TextsTab() {
  const { study = "" } = useParams({ strict: false });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {(detail) => <Texts key={detail.summary.revision} detail={detail} />}
    </Answer>
  );
}

/** The texts of one language as a record of strings. */
function textsOf(definition: Record<string, unknown>, language: string): Record<string, string> {
  const all = definition["texts"] as Record<string, Record<string, string>>;
  return all[language] ?? {};
}

function Texts({ detail }: { detail: Schemas["StudyDetail"] }) {
  const languages = detail.definition["languages"] as string[];
  const [language, setLanguage] = useState(languages[0] ?? "en");
  const [edits, setEdits] = useState<Record<string, string>>({});
  const mayChange = useMay("experimenter");
  const { name, revision, status } = detail.summary;
  const save = useChange(
    () =>
      unwrap(
        api.PUT("/api/admin/studies/{study}/texts", {
          params: { path: { study: name } },
          body: { revision, language, texts: edits },
        }),
      ),
    { touches: [["study", name]], done: "Saved as a new version." },
  );
  const present = textsOf(detail.definition, language);
  return (
    <Stack maw={860}>
      {status === "live" && mayChange && (
        <Alert color="yellow">This study is live. A change makes a new version; runs under way keep theirs.</Alert>
      )}
      <Select
        label="Language"
        data={languages}
        value={language}
        allowDeselect={false}
        onChange={(chosen) => {
          setLanguage(chosen ?? language);
          setEdits({});
        }}
        maw={160}
      />
      {Object.entries(PAGES).map(([page, label]) => (
        <Textarea
          key={page}
          label={`${label} (Markdown)`}
          autosize
          minRows={3}
          maxRows={20}
          readOnly={!mayChange}
          value={edits[page] ?? present[page] ?? ""}
          onChange={(event) => setEdits({ ...edits, [page]: event.currentTarget.value })}
        />
      ))}
      {mayChange && (
        <Group>
          <Button
            disabled={Object.keys(edits).length === 0}
            loading={save.isPending}
            onClick={() => save.mutate(undefined)}
          >
            Save
          </Button>
          <Button variant="default" disabled={Object.keys(edits).length === 0} onClick={() => setEdits({})}>
            Undo changes
          </Button>
        </Group>
      )}
    </Stack>
  );
}
