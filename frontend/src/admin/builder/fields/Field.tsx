/** The editors of the declaration's keys, chosen by their schema: tables, lists of tables, and an element per line. */

import { SimpleGrid, Stack, Textarea, Button, Group, TextInput, Alert, Fieldset, Menu, Select, Switch, Text } from "@mantine/core";
import { useState } from "react";
import { counted, languageName, plain } from "../../ui/format";
import {
  type Data,
  isTable,
  textAt,
  freeName,
  listAt,
  type Path,
  withMoved,
  pathName,
  labelOf,
  singularOf,
  tableAt,
  keyName,
  valueAt,
  withFirstFactor,
} from "../data";
import {
  editorOf,
  type Editor,
  helpOf,
  isBasic,
  TUCKED,
  mayBeNull,
  resolved,
  type Schema,
  starter,
  starterOf,
  withoutNull,
} from "../schema";
import { type FieldProps, useField, Choice, Flag, Lists, Numeric, OneText, Raw, Translated, Words } from "./scalars";
import { useBuilderHere } from "../useBuilder";

// Editors that take an element per line.

/** Texts in an order, each in every language: one line per text. */
function Translations(props: FieldProps) {
  const { value, label, help, problem, set, builder } = useField(props);
  const texts = Array.isArray(value) ? (value as unknown[]) : [];
  const change = (language: string, entered: string) => {
    const lines = entered === "" ? [] : entered.split("\n");
    const others = texts.map((text) => (isTable(text) ? text : {}));
    const length = builder.languages.length === 1 ? lines.length : Math.max(lines.length, lines.length === 0 ? 0 : others.length);
    const next: Data[] = Array.from({ length }, (_, index) => ({ ...others[index], [language]: lines[index] ?? "" }));
    set(next.length === 0 ? undefined : next);
  };
  return (
    <SimpleGrid cols={{ base: 1, sm: Math.min(2, builder.languages.length) }} spacing="xs" verticalSpacing={4}>
      {builder.languages.map((language, index) => (
        <Textarea
          key={language}
          label={builder.languages.length > 1 ? `${label}, ${languageName(language)}` : label}
          description={`${help} One per line.`}
          error={index === 0 ? problem : null}
          autosize
          minRows={2}
          maxRows={12}
          value={texts.map((text) => textAt(text, [language])).join("\n")}
          onChange={(event) => change(language, event.currentTarget.value)}
        />
      ))}
    </SimpleGrid>
  );
}

/** Numbers in an order, one per line. Text that is not a number stays out until it is one. */
function Numbers(props: FieldProps) {
  const { value, label, help, problem, set } = useField(props);
  const [text, setText] = useState(() => (Array.isArray(value) ? value.map(String).join("\n") : ""));
  return (
    <Textarea
      label={label}
      description={`${help} One per line.`}
      error={problem}
      autosize
      minRows={2}
      maxRows={12}
      value={text}
      onChange={(event) => {
        setText(event.currentTarget.value);
        const lines = event.currentTarget.value.split("\n").map((line) => line.trim());
        const numbers = lines.filter((line) => line !== "").map(Number);
        set(numbers.length === 0 ? undefined : numbers.filter((number) => Number.isFinite(number)));
      }}
    />
  );
}

/** A number where the key holds numbers and it is one; what is none is said by the check. */
function valueOf(entered: string, of: "text" | "number"): string | number {
  return of === "number" && entered !== "" && Number.isFinite(Number(entered)) ? Number(entered) : entered;
}

/** Words that stand for words or numbers: `key = value`, one per line. */
function Dictionary(props: FieldProps) {
  const { value, label, help, problem, set } = useField(props);
  const editor = editorOf(props.schema);
  const of = editor.kind === "dictionary" ? editor.of : "text";
  const [text, setText] = useState(() =>
    Object.entries(isTable(value) ? value : {})
      .map(([key, word]) => `${key} = ${String(word)}`)
      .join("\n"),
  );
  return (
    <Textarea
      label={label}
      description={`${help} One key = value per line.`}
      error={problem}
      autosize
      minRows={2}
      maxRows={12}
      value={text}
      onChange={(event) => {
        setText(event.currentTarget.value);
        const pairs = event.currentTarget.value.split("\n").map((line) => line.split("=").map((part) => part.trim()));
        const full = pairs.filter(([key, ...rest]) => key !== undefined && key !== "" && rest.length > 0);
        set(full.length === 0 ? undefined : Object.fromEntries(full.map(([key, ...rest]) => [key, valueOf(rest.join("="), of)])));
      }}
    />
  );
}

// Names for elements that are added or copied, so that each name is unique.

/** `element` with a name (or stored value) that none of `others` has. */
export function named(element: unknown, others: readonly unknown[], what = "name"): unknown {
  if (!isTable(element)) return element;
  const key = "name" in element ? "name" : "value" in element && "label" in element ? "value" : null;
  if (key === null) return element;
  const taken = others.map((other) => textAt(other, [key]));
  const name = freeName(textAt(element, [key]) || what.replaceAll(" ", "_"), taken);
  const label = element["label"];
  return { ...element, [key]: name, ...(label === "" ? { label: name } : {}) };
}

// What can be done with one element of a list.

interface ButtonsProps {
  path: Path;
  title: string;
  count: number;
  /** Signs in the place of words, on a line that holds more. */
  short?: boolean;
}

const SIGNS = { Up: "↑", Down: "↓", Copy: "+", Remove: "✕" };

function ElementButtons({ path, title, count, short = false }: ButtonsProps) {
  const builder = useBuilderHere();
  const list = path.slice(0, -1);
  const position = Number(path.at(-1));
  const change = (to: (elements: unknown[]) => unknown[]) => builder.set(list, to(listAt(builder.data, list)));
  const button = (word: keyof typeof SIGNS, does: () => void, disabled = false) => (
    <Button size="compact-xs" variant="default" disabled={disabled} aria-label={`${word} ${title}`} title={word} onClick={does}>
      {short ? SIGNS[word] : word}
    </Button>
  );
  return (
    <Group gap={4} wrap="nowrap">
      {button("Up", () => change((elements) => withMoved(elements, position, position - 1)), position === 0)}
      {button("Down", () => change((elements) => withMoved(elements, position, position + 1)), position === count - 1)}
      {button("Copy", () => change((elements) => elements.toSpliced(position + 1, 0, named(elements[position], elements))))}
      {button("Remove", () => change((elements) => elements.toSpliced(position, 1)))}
    </Group>
  );
}

// An element as small as a level or an option: its name and label on one line.

type TableEditor = Extract<Editor, { kind: "table" }>;

/** Whether elements are named and labeled, and little else. */
function fitsRow({ keys }: TableEditor): boolean {
  const names = keys.map(([name]) => name);
  return keys.length <= 3 && names.includes("label") && (names.includes("name") || names.includes("value"));
}

interface RowProps {
  path: Path;
  editor: TableEditor;
  element: unknown;
  count: number;
}

function Row({ path, editor, element, count }: RowProps) {
  const builder = useBuilderHere();
  const [key = "name"] = editor.keys.map(([name]) => name).filter((name) => name !== "label");
  const name = textAt(element, [key]);
  const label = isTable(element) ? element["label"] : "";
  const row = pathName(path);
  const problem = builder.problems.find((one) => one.path === `${row}.${key}` || one.path === row)?.message ?? null;
  // A label that says no more than the name follows it.
  const rename = (text: string) =>
    builder.set(path, { ...(isTable(element) ? element : {}), [key]: text, label: following(label, name, text) });
  // What a level changes is said of clips that are rendered, or where it is set.
  const more = editor.keys.filter(([inner]) => inner !== key && inner !== "label" && isTable(valueAt(element, [inner])));
  const isDerivedName = key === "value";
  // The lines below the first have the same labels: only the first shows them.
  const naming = (words: string) => (Number(path.at(-1)) === 0 ? { label: words } : { "aria-label": words });
  const nameField = (
    <TextInput
      {...(isDerivedName ? { label: "Stored value" } : naming("Name"))}
      value={name}
      error={problem}
      w={150}
      onChange={(event) => rename(event.currentTarget.value)}
    />
  );
  return (
    <div className="element-row">
      <Group gap="xs" align="end" wrap="wrap">
        {!isDerivedName && nameField}
        {isTable(label) ? (
          builder.languages.map((language) => (
            <TextInput
              key={language}
              {...naming(`Label, ${languageName(language)}`)}
              flex="1 1 150px"
              value={textAt(label, [language])}
              onChange={(event) => builder.set([...path, "label"], { ...label, [language]: event.currentTarget.value })}
            />
          ))
        ) : (
          <TextInput
            {...naming("Label")}
            flex="1 1 150px"
            value={typeof label === "string" ? label : ""}
            onChange={(event) => builder.set([...path, "label"], event.currentTarget.value)}
          />
        )}
        <ElementButtons path={path} title={name} count={count} short />
        {isDerivedName && (
          <details open={problem !== null || undefined}>
            <summary className="small-summary">Stored as {name}</summary>
            {nameField}
          </details>
        )}
        {more.map(([inner, schema]) => (
          <details key={inner}>
            <summary className="small-summary">What it changes: {inner}</summary>
            <Field path={[...path, inner]} schema={schema} />
          </details>
        ))}
      </Group>
    </div>
  );
}

function following(label: unknown, before: string, after: string): unknown {
  if (typeof label === "string") return label === "" || label === before ? after : label;
  if (!isTable(label)) return label;
  return Object.fromEntries(Object.entries(label).map(([language, text]) => [language, text === "" || text === before ? after : text]));
}

// Editors of tables, of tables of several kinds, and of lists of tables.

/** The keys of a table, one below the other: what every study decides and what is set; the rest under "More". */
function Keys({ path, editor, but = [] }: { path: Path; editor: TableEditor; but?: readonly string[] }) {
  const builder = useBuilderHere();
  const keys = editor.keys.filter(([name, schema]) => !but.includes(name) && editorOf(schema).kind !== "constant");
  // As it was when the page was opened: a key that is being typed into stays where it is.
  const [shown] = useState(() => {
    const isSet = (name: string) => valueAt(builder.data, [...path, name]) !== undefined;
    const isShown = (name: string) => {
      const key = keyName([...path, name]);
      return isBasic(key, editor.required.includes(name)) || (isSet(name) && !TUCKED.has(key));
    };
    const names = keys.map(([name]) => name).filter(isShown);
    // Of a table that decides nothing the first key stands for the rest.
    return new Set(names.length > 0 || keys.length > 4 ? names : keys.map(([name]) => name));
  });
  const more = keys.filter(([name]) => !shown.has(name));
  const wrong = more.some(([name]) => isWrong(builder.problems, [...path, name]));
  const field = ([name, schema]: (typeof keys)[number]) => (
    <div key={name} className={isNarrow(schema) ? "" : "wide"}>
      <Field path={[...path, name]} schema={schema} required={editor.required.includes(name)} />
    </div>
  );
  return (
    <Stack gap="sm">
      <div className="keys">{keys.filter(([name]) => shown.has(name)).map(field)}</div>
      {more.length > 0 && (
        <details open={wrong || undefined}>
          <summary className="small-summary">More: {more.map(([name]) => labelOf(name).toLowerCase()).join(", ")}</summary>
          <div className="keys">{more.map(field)}</div>
        </details>
      )}
    </Stack>
  );
}

/** Numbers, choices and switches are side by side where there is room. */
const isNarrow = (schema: Schema) => ["number", "choice", "flag", "text"].includes(editorOf(schema).kind);

function isWrong(problems: readonly { path: string }[], path: Path): boolean {
  return problems.some((problem) => `${problem.path}.`.startsWith(`${pathName(path)}.`));
}

function Table(props: FieldProps) {
  const { value, label, help, set, builder } = useField(props);
  const editor = editorOf(props.schema);
  if (editor.kind !== "table") return null;
  const optional = mayBeNull(props.schema);
  const inside = (
    <>
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
    </>
  );
  if (props.path.length === 1 && props.path[0] !== "render") return <Fieldset legend={label}>{inside}</Fieldset>;
  return (
    <details className="element" open={isWrong(builder.problems, props.path) || undefined}>
      <summary>
        <Text span fw={600} size="sm">
          {label}
        </Text>
        <Text span size="sm" c="dimmed" ml="xs">
          {settingsOf(value)}
        </Text>
      </summary>
      {inside}
    </details>
  );
}

const MAX_SETTINGS = 6;

/** What is set in a table, in a few words: "Amplitude: full; Motion blur: yes". */
function settingsOf(table: unknown): string {
  if (!isTable(table)) return "as usual";
  const words = (value: unknown) => (typeof value === "boolean" ? (value ? "yes" : "no") : plain(value).replaceAll("_", " "));
  const simple = Object.entries(table).filter(([, value]) => ["string", "number", "boolean"].includes(typeof value));
  const shown = simple.slice(0, MAX_SETTINGS).map(([key, value]) => `${labelOf(key)}: ${words(value)}`);
  return [...shown, ...(Object.keys(table).length > shown.length ? ["…"] : [])].join("; ");
}

/** One of several kinds of table; a key says which. */
function Variants(props: FieldProps) {
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
        renderOption={({ option }) => (
          <div>
            {option.label}
            <Text size="xs" c="dimmed">
              {helpOf(resolved(editor.variants[option.value] ?? {}))}
            </Text>
          </div>
        )}
        value={variant === undefined ? null : chosen}
        onChange={(tag) => {
          if (tag === null) set(undefined);
          else set(withFirstFactor(builder.data, props.path, starterOf(editor, tag, builder.languages, table)));
        }}
      />
      {keys?.kind === "table" && <Keys key={chosen} path={props.path} editor={keys} but={[editor.tag]} />}
    </Stack>
  );
}

/** Tables in an order that the user sets: added, moved, removed. */
function Elements(props: FieldProps) {
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
  const [isNew] = useState(() => listAt(builder.saved, path.slice(0, -1)).length <= Number(path.at(-1)));
  const inner = editorOf(schema);
  if (inner.kind === "table" && fitsRow(inner)) return <Row path={path} editor={inner} element={element} count={count} />;
  const title = titleOf(element) || `${labelOf(String(path.at(-2) ?? "")).toLowerCase()} ${Number(path.at(-1)) + 1}`;
  const wrong = isWrong(builder.problems, path);
  const about = aboutOf(element);
  return (
    <details className="element" open={wrong || isNew || (count === 1 && path.length === 2) || undefined}>
      <summary>
        <Text span fw={600} size="sm">
          {title}
        </Text>
        {about !== "" && (
          <Text span size="sm" c="dimmed" ml="xs">
            {about}
          </Text>
        )}
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

/** What an element holds, in a few words: its type, its answers or levels, how many questions. */
function aboutOf(element: unknown): string {
  const names = (key: string) => listAt(element, [key]).map((one) => titleOf(one).replace(/^[^:]*: /, ""));
  const type = textAt(element, ["type"]).replaceAll("_", " ");
  const fields = listAt(element, ["fields"]).length;
  const inside = [...names("levels"), ...names("options")];
  return [type, inside.join(", "), fields > 0 ? counted(fields, "question") : ""].filter((part) => part !== "").join(": ");
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

/** One table per language. */
function ByLanguage(props: FieldProps) {
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

// The editor of one key of the declaration, chosen by its schema.

export function Field(props: FieldProps) {
  switch (editorOf(props.schema).kind) {
    case "constant":
      return null;
    case "flag":
      return <Flag {...props} />;
    case "number":
      return <Numeric {...props} />;
    case "choice":
      return <Choice {...props} />;
    case "text":
      return <OneText {...props} />;
    case "translated":
      return <Translated {...props} />;
    case "words":
      return <Words {...props} />;
    case "numbers":
      return <Numbers {...props} />;
    case "lists":
      return <Lists {...props} />;
    case "translations":
      return <Translations {...props} />;
    case "dictionary":
      return <Dictionary {...props} />;
    case "table":
      return <Table {...props} />;
    case "variants":
      return <Variants {...props} />;
    case "elements":
      return <Elements {...props} />;
    case "languages":
      return <ByLanguage {...props} />;
    case "raw":
      return <Raw {...props} />;
  }
}
