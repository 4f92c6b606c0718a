/** An element as small as a level or an option: its name and label on one line. */

import { Group, TextInput } from "@mantine/core";
import { languageName } from "../../ui/format";
import { isTable, type Path, pathName, textAt } from "../data";
import type { Editor } from "../schema";
import { useBuilderHere } from "../useBuilder";
import { ElementButtons } from "./ElementButtons";
import { Field } from "./Field";

type TableEditor = Extract<Editor, { kind: "table" }>;

/** Whether elements are named and labelled, and little else. */
export function fitsRow({ keys }: TableEditor): boolean {
  const names = keys.map(([name]) => name);
  return keys.length <= 3 && names.includes("label") && (names.includes("name") || names.includes("value"));
}

interface Props {
  path: Path;
  editor: TableEditor;
  element: unknown;
  count: number;
}

export function Row({ path, editor, element, count }: Props) {
  const builder = useBuilderHere();
  const [key = "name"] = editor.keys.map(([name]) => name).filter((name) => name !== "label");
  const name = textAt(element, [key]);
  const label = isTable(element) ? element["label"] : "";
  const row = pathName(path);
  const problem = builder.problems.find((one) => one.path === `${row}.${key}` || one.path === row)?.message ?? null;
  // A label that says no more than the name follows it.
  const rename = (text: string) =>
    builder.set(path, { ...(isTable(element) ? element : {}), [key]: text, label: following(label, name, text) });
  const more = editor.keys.filter(([inner]) => inner !== key && inner !== "label");
  return (
    <div className="element-row">
      <Group gap="xs" align="end" wrap="wrap">
        <TextInput
          label={key === "value" ? "Stored value" : "Name"}
          value={name}
          error={problem}
          w={150}
          onChange={(event) => rename(event.currentTarget.value)}
        />
        {isTable(label) ? (
          builder.languages.map((language) => (
            <TextInput
              key={language}
              label={`Label, ${languageName(language)}`}
              flex="1 1 150px"
              value={textAt(label, [language])}
              onChange={(event) => builder.set([...path, "label"], { ...label, [language]: event.currentTarget.value })}
            />
          ))
        ) : (
          <TextInput
            label="Label"
            flex="1 1 150px"
            value={typeof label === "string" ? label : ""}
            onChange={(event) => builder.set([...path, "label"], event.currentTarget.value)}
          />
        )}
        <ElementButtons path={path} title={name} count={count} />
      </Group>
      {more.map(([inner, schema]) => (
        <details key={inner}>
          <summary className="small-summary">What it changes: {inner}</summary>
          <Field path={[...path, inner]} schema={schema} />
        </details>
      ))}
    </div>
  );
}

function following(label: unknown, before: string, after: string): unknown {
  if (typeof label === "string") return label === "" || label === before ? after : label;
  if (!isTable(label)) return label;
  return Object.fromEntries(Object.entries(label).map(([language, text]) => [language, text === "" || text === before ? after : text]));
}
