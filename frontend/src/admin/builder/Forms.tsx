/** Forms and texts of a study: added from a bank of questionnaires, written in every language. */

import { Button, FileButton, Group, Menu, Stack, Text, Paper, SegmentedControl, SimpleGrid, Textarea } from "@mantine/core";
import { downloadText, notify } from "../ui/useChange";
import { FORMS, inLanguages, CONSENTS, unfilledMarks, withKnown } from "./bank";
import { isTable, listAt, textAt, labelOf, type Path } from "./data";
import { Field, named } from "./fields/Field";
import { EXPERIMENT, type Editor, editorOf } from "./schema";
import { useBuilderHere } from "./useBuilder";
import { useEffect, useRef, useState } from "react";
import { markdown } from "../../ui/markdown";
import { languageName } from "../ui/format";
import { useField } from "./fields/scalars";

// Questionnaires: from the bank, from a file, or new ones.

export function Forms() {
  const builder = useBuilderHere();
  const forms = listAt(builder.data, ["forms"]);
  const add = (form: unknown) => builder.set(["forms"], [...forms, named(inLanguages(form, builder.languages), forms, "form")]);
  const take = async (file: File | null) => {
    if (file === null) return;
    const form = formIn(await file.text());
    if (form === null)
      notify({
        title: "No form in this file",
        message: `Expected a form saved here (JSON with name, title and fields), got ${file.name}.`,
        color: "red",
      });
    else add(form);
  };
  return (
    <Stack>
      <Group gap="xs">
        <Menu position="bottom-start">
          <Menu.Target>
            <Button size="xs">Add from the question bank ▾</Button>
          </Menu.Target>
          <Menu.Dropdown>
            {FORMS.map(({ title, about, form }) => (
              <Menu.Item key={title} onClick={() => add(form)}>
                {title}
                <Text size="xs" c="dimmed">
                  {about}
                </Text>
              </Menu.Item>
            ))}
          </Menu.Dropdown>
        </Menu>
        <FileButton accept=".json,application/json" onChange={(file) => void take(file)}>
          {(props) => (
            <Button size="xs" variant="default" {...props}>
              From a file
            </Button>
          )}
        </FileButton>
        {forms.map((form, index) => (
          <Button
            key={index}
            size="xs"
            variant="default"
            onClick={() => downloadText(`${textAt(form, ["name"])}.json`, JSON.stringify(form, null, 2), "application/json")}
          >
            Save “{textAt(form, ["name"])}” as a file
          </Button>
        ))}
      </Group>
      <Field path={["forms"]} schema={EXPERIMENT.properties?.["forms"] ?? {}} />
    </Stack>
  );
}

function formIn(text: string): unknown {
  try {
    const parsed: unknown = JSON.parse(text);
    return isTable(parsed) && typeof parsed["name"] === "string" && Array.isArray(parsed["fields"]) ? parsed : null;
  } catch {
    return null;
  }
}

// The pages a participant reads: written on the left, as they will look on the right.

export function Texts() {
  const builder = useBuilderHere();
  const [chosen, setChosen] = useState<string | null>(null);
  const language = chosen !== null && builder.languages.includes(chosen) ? chosen : (builder.languages[0] ?? "en");
  const editor = editorOf(EXPERIMENT.properties?.["texts"] ?? {});
  const table = editor.kind === "languages" ? editorOf(editor.of) : null;
  if (table?.kind !== "table") return null;
  return (
    <Stack>
      {builder.languages.length > 1 && (
        <SegmentedControl
          aria-label="Language"
          value={language}
          onChange={setChosen}
          data={builder.languages.map((code) => ({ value: code, label: languageName(code) }))}
          style={{ alignSelf: "flex-start" }}
        />
      )}
      <ConsentMenu language={language} />
      <Pages key={language} language={language} table={table} />
    </Stack>
  );
}

/** Pages that every study has, and those that are written; the others have words of the page's own. */
function Pages({ language, table }: { language: string; table: Extract<Editor, { kind: "table" }> }) {
  const builder = useBuilderHere();
  const isShown = (name: string) => table.required.includes(name) || textAt(builder.data, ["texts", language, name]) !== "";
  const [shown] = useState(() => new Set(table.keys.map(([name]) => name).filter(isShown)));
  const more = table.keys.filter(([name]) => !shown.has(name));
  const page = ([name, schema]: (typeof table.keys)[number]) => (
    <OnePage key={name} path={["texts", language, name]} schema={schema} required={table.required.includes(name)} />
  );
  return (
    <>
      {table.keys.filter(([name]) => shown.has(name)).map(page)}
      {more.length > 0 && (
        <details>
          <summary className="small-summary">More: {more.map(([name]) => labelOf(name).toLowerCase()).join(", ")}</summary>
          <Stack mt="xs">{more.map(page)}</Stack>
        </details>
      )}
    </>
  );
}

function ConsentMenu({ language }: { language: string }) {
  const builder = useBuilderHere();
  const texts = CONSENTS[language] ?? {};
  if (Object.keys(texts).length === 0) return null;
  const { data, design } = builder;
  const known = {
    title: textAt(data, ["participant_title", language]) || textAt(data, ["title"]),
    minutes: design === null ? "" : String(Math.max(1, Math.ceil(design.expected_minutes))),
  };
  const marks = unfilledMarks(textAt(data, ["texts", language, "consent"]));
  return (
    <Group>
      <Menu position="bottom-start">
        <Menu.Target>
          <Button size="xs" variant="light" rightSection="▾">
            Use a consent template
          </Button>
        </Menu.Target>
        <Menu.Dropdown>
          {Object.entries(texts).map(([title, text]) => (
            <Menu.Item key={title} onClick={() => builder.set(["texts", language, "consent"], withKnown(text, known))}>
              {title}
            </Menu.Item>
          ))}
        </Menu.Dropdown>
      </Menu>
      <Text size="xs" c="dimmed">
        {marks.length > 0
          ? `Still to fill in: ${marks.join(", ")}.`
          : "A template has words in [brackets], which are listed here until they are filled in. Undo restores the text."}
      </Text>
    </Group>
  );
}

function OnePage(props: { path: Path; schema: Parameters<typeof editorOf>[0]; required: boolean }) {
  const { value, help, problem, set, required } = useField(props);
  const text = textAt(value, []);
  const label = labelOf(String(props.path.at(-1)));
  return (
    <SimpleGrid cols={{ base: 1, md: 2 }} spacing="sm">
      <Textarea
        label={`${label} (Markdown)`}
        description={help}
        error={problem}
        required={required}
        autosize
        minRows={3}
        maxRows={8}
        value={text}
        onChange={(event) => set(event.currentTarget.value === "" && !required ? undefined : event.currentTarget.value)}
      />
      <Paper
        withBorder
        p="sm"
        mt={{ base: 0, md: 25 }}
        className="preview-text"
        tabIndex={0}
        role="group"
        aria-label={`${label}, as participants see it`}
      >
        <Shown text={text} />
      </Paper>
    </SimpleGrid>
  );
}

function Shown({ text }: { text: string }) {
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const parts = markdown(text === "" ? "*No text.*" : text);
    // Inside this page they are not its headings.
    for (const part of parts) if (/^H\d$/.test(part.tagName)) part.setAttribute("role", "presentation");
    box.current?.replaceChildren(...parts);
  }, [text]);
  return <div className="prose" ref={box} />;
}
