/** What varies between your own clips, and the question about them: the second half of New study, loaded with the first clips. */

import { Alert, Button, Input, SegmentedControl, SimpleGrid, Stack, Table, Text, Textarea, TextInput } from "@mantine/core";
import { useState } from "react";
import type { Schemas } from "../api";
import {
  cellsByPattern,
  gridProblem,
  levelsOfCells,
  type NewCells,
  reconciled,
  tableOfCells,
  tableToFill,
  uploadedPlaces,
} from "../builder/places";
import { StillNeeded } from "../clips/UploadClips";
import { onDemand } from "../ui/Answer";
import type { TemplateWords } from "./templates";
import {
  factorsOfTable,
  fieldsOf,
  levelsByPattern,
  levelsOfPattern,
  numbersProblem,
  patternProblem,
  reservedProblem,
  saysNothing,
  unnamedFactors,
  withNames,
} from "./file-pattern";

const MAX_ROWS = 100;
const NewGrid = onDemand(async () => (await import("../builder/LevelGrid")).NewGrid);

/** A refusal below the fold is scrolled to. */
const scrolledTo = (element: HTMLElement | null) => element?.scrollIntoView({ block: "nearest" });
const inWords = (levels: string[]) => `${levels.slice(0, 4).join(", ")}${levels.length > 4 ? " …" : ""}`;

const WAYS: Readonly<Record<string, string>> = {
  pattern: "The file names show which clip is which: each part in braces is something that varies.",
  grid: "Name what varies, then put each clip into its cell.",
  csv: "Paste a table with one row per clip.",
};

/** What is written about the study; until a question is written, it is the template's. */
export interface Asked {
  title: string;
  question: string | null;
  low: string;
  high: string;
}

interface LevelsProps {
  name: string;
  template: TemplateWords;
  asked: Asked;
  onAsk: (asked: Asked) => void;
  upload: Schemas["UploadOut"];
  /** Whether every file has been looked into. */
  isLooked: boolean;
  /** What is needed for every clip to play. */
  notPlayed: string | false;
  /** Why no study was made, but for its name. */
  refused: string | null;
  isCreating: boolean;
  onCreate: (study: Schemas["NewStudy"]) => void;
}

export function Levels({ name, template, asked: typed, onAsk, upload, isLooked, notPlayed, refused, isCreating, onCreate }: LevelsProps) {
  // As the files suggest it, also after one was left out or came, until it is written.
  const [written, setWritten] = useState<{ pattern?: string; csv?: string }>({});
  const pattern = written.pattern ?? upload.suggested_pattern ?? "";
  const csv = written.csv ?? tableToFill(upload.files.map((file) => file.name));
  const asked = { ...typed, question: typed.question ?? template.question };
  const [names, setNames] = useState<Record<string, string>>({});
  const files = upload.files.map((file) => file.name);
  const [chosenBy, setBy] = useState<string | null>(null);
  // Names that say nothing lead to the grid; a pattern that is written stays where it is.
  const by = chosenBy ?? (written.pattern === undefined && saysNothing(pattern, files) ? "grid" : "pattern");
  const [typedCells, setCells] = useState<NewCells | null>(null);
  const uploaded = uploadedPlaces(upload);
  const cells =
    typedCells === null
      ? cellsByPattern(uploaded, saysNothing(pattern, files) ? "" : withNames(pattern, names))
      : { ...typedCells, places: reconciled(typedCells.places, uploaded) };
  const lacks = {
    pattern: () =>
      patternProblem(withNames(pattern, names), files) || (template.isAlongNumbers && numbersProblem(levelsOfPattern(pattern, files))),
    grid: () => gridProblem(cells) || (template.isAlongNumbers && numbersProblem(levelsOfCells(cells))),
    csv: () => reservedProblem(factorsOfTable(csv)),
  }[by];
  const needed = [
    (!isLooked || files.length === 0) && "clips that have been checked",
    notPlayed,
    lacks?.() ?? false,
    name === "" && "a short name (above)",
    asked.title.trim() === "" && "a title of the study",
  ];
  const field = (key: keyof typeof asked, label: string) => (
    <TextInput label={label} value={asked[key]} onChange={(event) => onAsk({ ...typed, [key]: event.currentTarget.value })} />
  );
  return (
    <Stack>
      <Input.Wrapper label="What varies between the clips" description={WAYS[by]} labelElement="div">
        <SegmentedControl
          fullWidth
          mt="xs"
          aria-label="Where the levels come from"
          value={by}
          onChange={setBy}
          data={[
            { value: "pattern", label: "By file names" },
            { value: "grid", label: "In a grid" },
            { value: "csv", label: "By a table" },
          ]}
        />
      </Input.Wrapper>
      {by === "grid" && <NewGrid cells={cells} onChange={setCells} />}
      {by === "pattern" && (
        <>
          <TextInput
            label="Pattern"
            description="Names of factors in braces; {exemplar} numbers the clips of a cell."
            placeholder="{character}_{speed}_{exemplar}.mp4"
            value={pattern}
            onChange={(event) => setWritten({ ...written, pattern: event.currentTarget.value })}
          />
          <SimpleGrid cols={{ base: 1, sm: 2 }}>
            {unnamedFactors(pattern, files).map(({ field, levels }) => (
              <TextInput
                key={field}
                label={`What are ${inWords(levels)}?`}
                description={`The name of this factor in tables and figures, such as ‘speed’ for slow and fast. Default: ${field}.`}
                value={names[field] ?? ""}
                onChange={(event) => setNames({ ...names, [field]: event.currentTarget.value })}
              />
            ))}
          </SimpleGrid>
          <LevelsTable pattern={withNames(pattern, names)} files={files} />
        </>
      )}
      {by === "csv" && (
        <Textarea
          className="editor"
          label="Table (CSV)"
          description="The column file, then one column per factor. The column exemplar is optional."
          autosize
          minRows={6}
          maxRows={16}
          value={csv}
          onChange={(event) => setWritten({ ...written, csv: event.currentTarget.value })}
        />
      )}
      <SimpleGrid cols={{ base: 1, sm: 2 }}>
        {field("title", "Title of the study")}
        {field("question", "Question")}
        {template.ends && field("low", "Lowest answer means")}
        {template.ends && field("high", "Highest answer means")}
      </SimpleGrid>
      <StillNeeded parts={needed} />
      {refused !== null && (
        <Alert color="red" variant="light" title="The study was not created" role="alert" ref={scrolledTo}>
          {refused}
        </Alert>
      )}
      <Button
        style={{ alignSelf: "flex-start" }}
        disabled={needed.some(Boolean)}
        loading={isCreating}
        onClick={() =>
          onCreate({
            name,
            upload: upload.id,
            levels: by === "pattern" ? { pattern: withNames(pattern, names) } : { csv: by === "grid" ? tableOfCells(cells) : csv },
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
        {rows.length > MAX_ROWS && ` The first ${MAX_ROWS} are shown.`}
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
