/** Editors of tables, of tables of several kinds, and of lists of tables. */

import { Alert, Button, Fieldset, Menu, Select, Stack, Switch, Text } from "@mantine/core";
import { languageName } from "../../ui/format";
import { isTable, labelOf, listAt, type Path, pathName, singularOf, tableAt, textAt } from "../data";
import { helpOf } from "../help";
import { type Editor, editorOf, mayBeNull, resolved, type Schema, starter, starterOf, withoutNull } from "../schema";
import { useBuilderHere } from "../useBuilder";
import { ElementButtons } from "./ElementButtons";
import { Field } from "./Field";
import { named } from "./new-names";
import { fitsRow, Row } from "./Row";
import { type FieldProps, useField } from "./useField";

type TableEditor = Extract<Editor, { kind: "table" }>;

/** The keys of a table, one below the other. */
function Keys({ path, editor, but = [] }: { path: Path; editor: TableEditor; but?: readonly string[] }) {
  return (
    <Stack gap="sm">
      {editor.keys
        .filter(([name]) => !but.includes(name))
        .map(([name, schema]) => (
          <Field key={name} path={[...path, name]} schema={schema} required={editor.required.includes(name)} />
        ))}
    </Stack>
  );
}

export function Table(props: FieldProps) {
  const { value, label, help, set, builder } = useField(props);
  const editor = editorOf(props.schema);
  if (editor.kind !== "table") return null;
  const optional = mayBeNull(props.schema);
  return (
    <Fieldset legend={label}>
      <Text size="xs" c="dimmed" mb="xs">
        {help}
      </Text>
      {optional && (
        <Switch
          label={`With ${label.toLowerCase()}`}
          checked={isTable(value)}
          onChange={(event) =>
            set(event.currentTarget.checked ? starter(withoutNull(resolved(props.schema)), builder.languages) : undefined)
          }
          mb="xs"
        />
      )}
      {(!optional || isTable(value)) && <Keys path={props.path} editor={editor} />}
      <Problems path={props.path} />
    </Fieldset>
  );
}

/** One of several kinds of table, told apart by a key. */
export function Variants(props: FieldProps) {
  const { value, label, help, set, builder } = useField(props);
  const editor = editorOf(props.schema);
  if (editor.kind !== "variants") return null;
  const table = isTable(value) ? value : {};
  const optional = mayBeNull(props.schema);
  const [first = ""] = Object.keys(editor.variants);
  const implied = builder.trialKind in editor.variants ? builder.trialKind : first;
  const tagged = table[editor.tag];
  const chosen = typeof tagged === "string" ? tagged : optional && !isTable(value) ? "" : implied;
  const variant = editor.variants[chosen];
  const keys = variant === undefined ? null : editorOf(variant);
  return (
    <Stack gap="sm">
      <Select
        label={typeof props.path.at(-1) === "number" ? labelOf(editor.tag) : `${label}: ${editor.tag.replaceAll("_", " ")}`}
        description={variant === undefined ? help : helpOf(resolved(variant))}
        maw={480}
        allowDeselect={false}
        clearable={optional}
        data={Object.keys(editor.variants).map((tag) => ({ value: tag, label: tag.replaceAll("_", " ") }))}
        value={variant === undefined ? null : chosen}
        onChange={(tag) => set(tag === null ? undefined : starterOf(editor, tag, builder.languages, table))}
      />
      {keys?.kind === "table" && <Keys path={props.path} editor={keys} but={[editor.tag]} />}
    </Stack>
  );
}

/** Tables in an order of their own: added, moved, removed. */
export function Elements(props: FieldProps) {
  const { value, label, help } = useField(props);
  const editor = editorOf(props.schema);
  if (editor.kind !== "elements") return null;
  const elements = Array.isArray(value) ? (value as unknown[]) : [];
  return (
    <Fieldset legend={label}>
      <Text size="xs" c="dimmed" mb="xs">
        {help}
      </Text>
      <Stack gap="xs">
        {elements.map((element, index) => (
          <Element key={index} path={[...props.path, index]} schema={editor.of} element={element} count={elements.length} />
        ))}
        <Add path={props.path} of={editor.of} />
        <Problems path={props.path} />
      </Stack>
    </Fieldset>
  );
}

interface ElementProps {
  path: Path;
  schema: Schema;
  element: unknown;
  count: number;
}

function Element({ path, schema, element, count }: ElementProps) {
  const builder = useBuilderHere();
  const inner = editorOf(schema);
  if (inner.kind === "table" && fitsRow(inner)) return <Row path={path} editor={inner} element={element} count={count} />;
  const title = titleOf(element) || `${labelOf(String(path.at(-2) ?? "")).toLowerCase()} ${Number(path.at(-1)) + 1}`;
  const wrong = builder.problems.some((problem) => `${problem.path}.`.startsWith(`${pathName(path)}.`));
  return (
    <details className="element" open={wrong || count <= 3 || undefined}>
      <summary>
        <Text span fw={600} size="sm">
          {title}
        </Text>
        {wrong && (
          <Text span size="xs" c="red" ml="xs">
            needs a look
          </Text>
        )}
      </summary>
      <Stack gap="sm" mt="xs">
        {inner.kind === "table" ? <Keys path={path} editor={inner} /> : <Field path={path} schema={schema} />}
        <ElementButtons path={path} title={title} count={count} />
      </Stack>
    </details>
  );
}

function titleOf(element: unknown): string {
  const label = textAt(element, ["label"]) || textAt(element, ["label", "en"]) || Object.values(tableAt(element, ["label"])).map(String)[0];
  const name = textAt(element, ["name"]) || textAt(element, ["value"]) || textAt(element, ["rule"]).replaceAll("_", " ");
  return label && name && label !== name ? `${name}: ${label}` : name || label || "";
}

function Add({ path, of }: { path: Path; of: Schema }) {
  const builder = useBuilderHere();
  const editor = editorOf(of);
  const list = listAt(builder.data, path);
  const what = singularOf(labelOf(String(path.at(-1) ?? "")).toLowerCase());
  const add = (fresh: unknown) => builder.set(path, [...list, named(fresh, list, what)]);
  if (editor.kind !== "variants")
    return (
      <Button size="xs" variant="light" style={{ alignSelf: "flex-start" }} onClick={() => add(starter(of, builder.languages))}>
        Add {what}
      </Button>
    );
  return (
    <Menu position="bottom-start">
      <Menu.Target>
        <Button size="xs" variant="light" style={{ alignSelf: "flex-start" }}>
          Add {what} ▾
        </Button>
      </Menu.Target>
      <Menu.Dropdown>
        {Object.entries(editor.variants).map(([tag, schema]) => (
          <Menu.Item key={tag} onClick={() => add(starterOf(editor, tag, builder.languages))}>
            {tag.replaceAll("_", " ")}
            <Text size="xs" c="dimmed" maw={380}>
              {helpOf({ description: resolved(schema).description?.split("\n\n")[0] ?? "" })}
            </Text>
          </Menu.Item>
        ))}
      </Menu.Dropdown>
    </Menu>
  );
}

/** A table a language. */
export function ByLanguage(props: FieldProps) {
  const { builder } = useField(props);
  const editor = editorOf(props.schema);
  if (editor.kind !== "languages") return null;
  const inner = editorOf(editor.of);
  return (
    <Stack>
      {builder.languages.map((language) => (
        <Fieldset key={language} legend={languageName(language)}>
          {inner.kind === "table" && <Keys path={[...props.path, language]} editor={inner} />}
        </Fieldset>
      ))}
    </Stack>
  );
}

/** What is wrong with a table as a whole. */
function Problems({ path }: { path: Path }) {
  const builder = useBuilderHere();
  const wrong = builder.problems.filter((problem) => problem.path === pathName(path));
  if (wrong.length === 0) return null;
  return (
    <Alert color="red" variant="light" mt="xs">
      {wrong.map((problem) => problem.message).join("; ")}
    </Alert>
  );
}
