/** A study from somebody's own clips: upload, say which levels each has, ask a question. */

import { Alert, Button, FileInput, Progress, SegmentedControl, Select, Stack, Table, Text, Textarea, TextInput } from "@mantine/core";
import { useState } from "react";
import type { Schemas } from "../api";
import { useChange } from "../ui/useChange";
import { TEMPLATES } from "./templates";
import { uploadFiles, useCreate } from "./useCreate";

export function FromOwnClips({ name }: { name: string }) {
  const [upload, setUpload] = useState<Schemas["UploadOut"] | null>(null);
  const send = useChange(uploadFiles, { touches: [], then: setUpload });
  return (
    <Stack>
      <FileInput
        label="Clips"
        description="MP4 files, or a zip of them; a CSV of levels may be among them."
        accept=".zip,.mp4,.m4v,.mov,.webm,.csv"
        multiple
        onChange={(files) => files.length > 0 && send.mutate(files)}
        maw={500}
      />
      {send.isPending && <Progress value={100} animated aria-label="Uploading and looking into the clips" />}
      {upload !== null && <Received upload={upload} />}
      {upload !== null && upload.files.length > 0 && <Levels name={name} upload={upload} />}
    </Stack>
  );
}

function Received({ upload }: { upload: Schemas["UploadOut"] }) {
  const wrong = upload.files.filter((file) => file.problem !== null && file.problem !== undefined);
  const [first] = upload.files;
  return (
    <>
      <Text>
        {upload.files.length} clips received
        {first?.frames != null && `; the first has ${first.frames} frames at ${first.fps} fps, ${first.width_px} x ${first.height_px}`}.
      </Text>
      {wrong.length > 0 && (
        <Alert color="red" variant="light" title={`${wrong.length} files cannot be used`}>
          {wrong.slice(0, 10).map((file) => (
            <Text key={file.name} size="sm">
              {file.name}: {file.problem}
            </Text>
          ))}
        </Alert>
      )}
    </>
  );
}

function Levels({ name, upload }: { name: string; upload: Schemas["UploadOut"] }) {
  const [by, setBy] = useState("pattern");
  const [pattern, setPattern] = useState(upload.suggested_pattern ?? "");
  const [csv, setCsv] = useState(`file,factor\n${upload.files.map((file) => `${file.name},`).join("\n")}`);
  const [template, setTemplate] = useState(TEMPLATES[0]);
  const [asked, setAsked] = useState({ title: "", question: template.question, low: "very unnatural", high: "very natural" });
  const create = useCreate();
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

/** What the pattern reads from the first names. */
function Example({ pattern, files }: { pattern: string; files: string[] }) {
  const fields = [...pattern.matchAll(/\{([A-Za-z]\w*)\}/g)].map((match) => match[1] ?? "");
  const source = pattern
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
          const found = matcher.exec(file);
          return (
            <Table.Tr key={file}>
              <Table.Td>{file}</Table.Td>
              {fields.map((field, place) => (
                <Table.Td key={field}>{found?.[place + 1] ?? "does not fit"}</Table.Td>
              ))}
            </Table.Tr>
          );
        })}
      </Table.Tbody>
    </Table>
  );
}
