/** A study from somebody's own clips: upload, say which levels each has, ask a question. */

import { Alert, Button, SegmentedControl, Select, Stack, Table, Text, Textarea, TextInput } from "@mantine/core";
import { useState } from "react";
import type { Schemas } from "../api";
import { UploadClips } from "../clips/UploadClips";
import { playNeeded, useUpload } from "../clips/useUpload";
import { factorsOfTable, fieldsOf, levelsByPattern, patternProblem, reservedProblem, unnamedFactors, withNames } from "./file-pattern";
import { StillNeeded } from "./StillNeeded";
import { TEMPLATES } from "./templates";
import { refusal, useCreate } from "./useCreate";

const MAX_ROWS = 100;

export function FromOwnClips({ name, onTaken }: { name: string; onTaken: (message: string) => void }) {
  const upload = useUpload("new study");
  const { last, received } = upload;
  return (
    <Stack>
      <UploadClips upload={upload} />
      {last !== null && (
        <Levels
          key={last.id}
          name={name}
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

const inWords = (levels: string[]) => `${levels.slice(0, 4).join(", ")}${levels.length > 4 ? " …" : ""}`;

interface LevelsProps {
  name: string;
  upload: Schemas["UploadOut"];
  /** Whether every file has been looked into. */
  isLooked: boolean;
  /** What is needed for every clip to play. */
  notPlayed: string | false;
  onTaken: (message: string) => void;
  onCreated: () => void;
}

function Levels({ name, upload, isLooked, notPlayed, onTaken, onCreated }: LevelsProps) {
  const [by, setBy] = useState("pattern");
  // As the files suggest it, also after one was left out or came, until it is written.
  const [written, setWritten] = useState<{ pattern?: string; csv?: string }>({});
  const pattern = written.pattern ?? upload.suggested_pattern ?? "";
  const csv = written.csv ?? `file,factor\n${upload.files.map((file) => `${file.name},`).join("\n")}`;
  const [template, setTemplate] = useState(TEMPLATES[0]);
  const [asked, setAsked] = useState({ title: "", question: template.question, low: "very unnatural", high: "very natural" });
  const [names, setNames] = useState<Record<string, string>>({});
  const files = upload.files.map((file) => file.name);
  const create = useCreate(onTaken, onCreated, true);
  const refused = refusal(create.error);
  const needed = [
    (!isLooked || files.length === 0) && "clips that have been looked into",
    notPlayed,
    by === "pattern" ? patternProblem(withNames(pattern, names), files) : reservedProblem(factorsOfTable(csv)),
    name === "" && "a short name (above)",
    asked.title.trim() === "" && "a title of the study",
  ];
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
          { value: "pattern", label: "By file names" },
          { value: "csv", label: "By a table" },
        ]}
      />
      {by === "pattern" ? (
        <>
          <TextInput
            label="Pattern"
            description="Names of factors in braces; {exemplar} numbers the clips of a cell."
            placeholder="{character}_{speed}_{exemplar}.mp4"
            value={pattern}
            onChange={(event) => setWritten({ ...written, pattern: event.currentTarget.value })}
          />
          {unnamedFactors(pattern, files).map(({ field, levels }) => (
            <TextInput
              key={field}
              label={`What are ${inWords(levels)}?`}
              description={`The name of this factor in tables and figures: what they are levels of, as slow and fast are of ‘speed’. Left open it is called ${field}.`}
              value={names[field] ?? ""}
              onChange={(event) => setNames({ ...names, [field]: event.currentTarget.value })}
              maw={400}
            />
          ))}
          <LevelsTable pattern={withNames(pattern, names)} files={files} />
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
          onChange={(event) => setWritten({ ...written, csv: event.currentTarget.value })}
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
      <StillNeeded parts={needed} />
      {refused !== null && (
        <Alert color="red" variant="light" title="The study was not created" role="alert">
          {refused}
        </Alert>
      )}
      <Button
        style={{ alignSelf: "flex-start" }}
        disabled={needed.some(Boolean)}
        loading={create.isPending}
        onClick={() =>
          create.mutate({
            name,
            upload: upload.id,
            levels: by === "pattern" ? { pattern: withNames(pattern, names) } : { csv },
            own_clips: { ...asked, template: template.value },
          })
        }
      >
        Create
      </Button>
    </Stack>
  );
}

/** What the pattern reads from the names: all of a usual study, of thousands the first, those that do not fit before them. */
function LevelsTable({ pattern, files }: { pattern: string; files: string[] }) {
  const fields = fieldsOf(pattern);
  if (fields.length === 0) return null;
  const rows = levelsByPattern(pattern, files);
  const strays = rows.filter(({ levels }) => levels === null).length;
  return (
    <div>
      <Text size="sm" mb={4} role="status">
        {strays === 0
          ? `All ${files.length} file names fit the pattern.`
          : `${strays} of ${files.length} file names do not fit the pattern.`}
        {rows.length > MAX_ROWS && ` Shown are ${MAX_ROWS} of them.`}
      </Text>
      <div className="long-list levels" tabIndex={0} role="region" aria-label="Levels of the files">
        <Table aria-label="What the pattern reads">
          <Table.Thead>
            <Table.Tr>
              <Table.Th>file</Table.Th>
              {fields.map((field) => (
                <Table.Th key={field}>{field}</Table.Th>
              ))}
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {rows.slice(0, MAX_ROWS).map(({ file, levels }) => (
              <Table.Tr key={file}>
                <Table.Td className="wrap-anywhere">{file}</Table.Td>
                {fields.map((field, index) => (
                  <Table.Td key={field}>{levels?.[index] ?? "does not fit"}</Table.Td>
                ))}
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </div>
    </div>
  );
}
