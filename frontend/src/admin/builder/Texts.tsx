/** The pages a participant reads: written on the left, as they will look on the right. */

import { Button, Group, Menu, Paper, SegmentedControl, SimpleGrid, Stack, Text, Textarea } from "@mantine/core";
import { useEffect, useRef, useState } from "react";
import { markdown } from "../../ui/markdown";
import { languageName } from "../ui/format";
import { CONSENTS } from "./bank";
import { labelOf, type Path, textAt } from "./data";
import { EXPERIMENT, editorOf } from "./schema";
import { useField } from "./fields/useField";
import { useBuilderHere } from "./useBuilder";

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
      {table.keys.map(([name, schema]) => (
        <OnePage key={`${language}.${name}`} path={["texts", language, name]} schema={schema} required={table.required.includes(name)} />
      ))}
    </Stack>
  );
}

function ConsentMenu({ language }: { language: string }) {
  const builder = useBuilderHere();
  const texts = CONSENTS[language] ?? {};
  if (Object.keys(texts).length === 0) return null;
  return (
    <Group>
      <Menu position="bottom-start">
        <Menu.Target>
          <Button size="xs" variant="light">
            Begin the consent with ▾
          </Button>
        </Menu.Target>
        <Menu.Dropdown>
          {Object.entries(texts).map(([title, text]) => (
            <Menu.Item key={title} onClick={() => builder.set(["texts", language, "consent"], text)}>
              {title}
            </Menu.Item>
          ))}
        </Menu.Dropdown>
      </Menu>
      <Text size="xs" c="dimmed">
        Words in [brackets] are yours to fill in. Undo brings the text back.
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
        maxRows={20}
        value={text}
        onChange={(event) => set(event.currentTarget.value === "" && !required ? undefined : event.currentTarget.value)}
      />
      <Paper withBorder p="sm" mt={{ base: 0, md: 25 }} role="group" aria-label={`${label}, as participants see it`}>
        <Shown text={text} />
      </Paper>
    </SimpleGrid>
  );
}

function Shown({ text }: { text: string }) {
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const parts = markdown(text === "" ? "*No text.*" : text);
    // Inside this page they are no headings of it.
    for (const part of parts) if (/^H\d$/.test(part.tagName)) part.setAttribute("role", "presentation");
    box.current?.replaceChildren(...parts);
  }, [text]);
  return <div className="prose" ref={box} />;
}
