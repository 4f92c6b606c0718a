/** A study from somebody's own clips: upload, say which levels each has, ask a question. */

import { Button, SegmentedControl, Select, Stack, Table, Text, Textarea, TextInput } from "@mantine/core";
import { useState } from "react";
import type { Schemas } from "../api";
import { UploadClips } from "../clips/UploadClips";
import { useUpload } from "../clips/useUpload";
import { TEMPLATES } from "./templates";
import { useCreate } from "./useCreate";

export function FromOwnClips({ name }: { name: string }) {
  const upload = useUpload("new study");
  const { received } = upload;
  return (
    <Stack>
      <UploadClips upload={upload} />
      {received !== null && received.files.length > 0 && (
        <Levels key={received.id} name={name} upload={received} onCreated={upload.forget} />
      )}
    </Stack>
  );
}

interface LevelsProps {
  name: string;
  upload: Schemas["UploadOut"];
  onCreated: () => void;
}

function Levels({ name, upload, onCreated }: LevelsProps) {
  const [by, setBy] = useState("pattern");
  const [pattern, setPattern] = useState(upload.suggested_pattern ?? "");
  const [csv, setCsv] = useState(`file,factor\n${upload.files.map((file) => `${file.name},`).join("\n")}`);
  const [template, setTemplate] = useState(TEMPLATES[0]);
  const [asked, setAsked] = useState({ title: "", question: template.question, low: "very unnatural", high: "very natural" });
  const create = useCreate(onCreated);
  const field = (key: keyof typeof asked, label: string) => (
    <TextInput label={label} value={asked[key]} onChange={(event) => setAsked({ ...asked, [key]: event.currentTarget.value })} />
  );
  return (
    <Stack>
      <SegmentedControl
        aria-label="Where the levels come from"
        value={by}
        onChange={setBy}
        data={[
          { value: "pattern", label: "Levels from file names" },
          { value: "csv", label: "Levels from a table" },
        ]}
      />
      {by === "pattern" ? (
        <>
          <TextInput
            label="Pattern"
            description="Names of factors in braces; {exemplar} numbers the clips of a cell."
            placeholder="{character}_{speed}_{exemplar}.mp4"
            value={pattern}
            onChange={(event) => setPattern(event.currentTarget.value)}
          />
          <Example pattern={pattern} files={upload.files.map((file) => file.name)} />
        </>
      ) : (
        <Textarea
          className="editor"
          label="Table (CSV)"
          description="Column file, then one column a factor; exemplar is optional."
          autosize
          minRows={6}
          maxRows={16}
          value={csv}
          onChange={(event) => setCsv(event.currentTarget.value)}
        />
      )}
      <Select
        label="What participants do"
        description={template.about}
        data={TEMPLATES.map(({ value, label }) => ({ value, label }))}
        value={template.value}
        allowDeselect={false}
        onChange={(value) => {
          const chosen = TEMPLATES.find((one) => one.value === value) ?? template;
          // A question of the experimenter's own stays.
          if (asked.question === template.question) setAsked({ ...asked, question: chosen.question });
          setTemplate(chosen);
        }}
      />
      {field("title", "Title of the study")}
      {field("question", "Question")}
      {template.ends && field("low", "Lowest answer means")}
      {template.ends && field("high", "Highest answer means")}
      {name === "" && <Text size="sm">Give the study a short name above.</Text>}
      <Button
        style={{ alignSelf: "flex-start" }}
        disabled={name === "" || asked.title === ""}
        loading={create.isPending}
        onClick={() =>
          create.mutate({
            name,
            upload: upload.id,
            levels: by === "pattern" ? { pattern } : { csv },
            own_clips: { ...asked, template: template.value },
          })
        }
      >
        Create
      </Button>
    </Stack>
  );
}

/** Files of several formats follow one pattern. */
const stemOf = (name: string) => name.replace(/\.[A-Za-z0-9]{1,4}$/, "");

/** What the pattern reads from the first names. */
function Example({ pattern, files }: { pattern: string; files: string[] }) {
  const fields = [...pattern.matchAll(/\{([A-Za-z]\w*)\}/g)].map((match) => match[1] ?? "");
  const source = stemOf(pattern)
    .split(/\{[A-Za-z]\w*\}/)
    .map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"))
    .join("([^/]+?)");
  const matcher = new RegExp(`^${source}$`);
  if (fields.length === 0) return null;
  return (
    <Table aria-label="What the pattern reads" className="wrap-anywhere">
      <Table.Thead>
        <Table.Tr>
          <Table.Th>file</Table.Th>
          {fields.map((field) => (
            <Table.Th key={field}>{field}</Table.Th>
          ))}
        </Table.Tr>
      </Table.Thead>
      <Table.Tbody>
        {files.slice(0, 4).map((file) => {
          const match = matcher.exec(stemOf(file));
          return (
            <Table.Tr key={file}>
              <Table.Td>{file}</Table.Td>
              {fields.map((field, index) => (
                <Table.Td key={field}>{match?.[index + 1] ?? "does not fit"}</Table.Td>
              ))}
            </Table.Tr>
          );
        })}
      </Table.Tbody>
    </Table>
  );
}
