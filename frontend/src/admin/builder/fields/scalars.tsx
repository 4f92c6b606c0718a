/** Editors of keys that hold one value, or a list of words. */

import { keyName, labelOf, type Path, pathName, valueAt, isTable, textAt, withValue, suggestionsFor } from "../data";
import { helpOf, effectOf, resolved, type Schema, editorOf } from "../schema";
import { useBuilderHere } from "../useBuilder";
import { Autocomplete, JsonInput, NumberInput, Select, SimpleGrid, Switch, TagsInput, Textarea, TextInput } from "@mantine/core";
import { useState } from "react";
import { languageName } from "../../ui/format";

// What every editor of a key needs: its value, its label and help, what is wrong with it, and the way to set it.

export interface FieldProps {
  path: Path;
  schema: Schema;
  required?: boolean;
}

export function useField({ path, schema, required = false }: FieldProps) {
  const builder = useBuilderHere();
  const name = String(path.at(-1) ?? "");
  const measured = effectOf(keyName(path), builder.trialKind) === "measured";
  const help = helpOf(resolved(schema));
  return {
    value: valueAt(builder.data, path),
    fallback: resolved(schema).default,
    label: labelOf(name),
    help: `${help}${measured ? " Starts a new data series." : ""}`.trim(),
    problem: builder.problems.find((one) => one.path === pathName(path))?.message ?? null,
    set: (value: unknown) => builder.set(path, value),
    required,
    builder,
  };
}

function shown(fallback: unknown): string {
  return fallback === undefined || fallback === null || fallback === ""
    ? ""
    : `${typeof fallback === "string" ? fallback : JSON.stringify(fallback)} (default)`;
}

/** Numbers and choices are short; the help above them is not. */
const NARROW = { wrapper: "narrow-field" };

export function Flag(props: FieldProps) {
  const { value, fallback, label, help, problem, set } = useField(props);
  const checked = typeof value === "boolean" ? value : fallback === true;
  return (
    <Switch label={label} description={help} error={problem} checked={checked} onChange={(event) => set(event.currentTarget.checked)} />
  );
}

export function Numeric(props: FieldProps) {
  const { value, fallback, label, help, problem, set, required } = useField(props);
  const editor = editorOf(props.schema);
  if (editor.kind !== "number") return null;
  return (
    <NumberInput
      label={label}
      description={help}
      error={problem}
      required={required}
      classNames={NARROW}
      placeholder={shown(fallback)}
      {...(editor.maximum === undefined ? {} : { max: editor.maximum })}
      {...(editor.minimum === undefined ? {} : { min: editor.minimum })}
      clampBehavior="none"
      value={typeof value === "number" ? value : ""}
      onChange={(entered) => {
        const number = typeof entered === "number" ? entered : Number.NaN;
        if (entered === "" || Number.isFinite(number)) set(entered === "" ? undefined : number);
      }}
    />
  );
}

export function Choice(props: FieldProps) {
  const { value, fallback, label, help, problem, set, required } = useField(props);
  const editor = editorOf(props.schema);
  if (editor.kind !== "choice") return null;
  return (
    <Select
      label={label}
      description={help}
      error={problem}
      required={required}
      classNames={NARROW}
      placeholder={shown(fallback)}
      data={editor.options.map((option) => ({ value: option, label: option.replaceAll("_", " ") }))}
      value={typeof value === "string" ? value : null}
      clearable={!required}
      allowDeselect={false}
      onChange={(chosen) => set(chosen ?? undefined)}
    />
  );
}

export function Words(props: FieldProps) {
  const { value, fallback, label, help, problem, set, required, builder } = useField(props);
  const words = Array.isArray(value) ? value.map(String) : Array.isArray(fallback) ? fallback.map(String) : [];
  return (
    <TagsInput
      label={label}
      description={help}
      error={problem}
      required={required}
      data={suggestionsFor(builder.data, props.path)}
      placeholder={words.length === 0 ? "none; press Enter to add one" : ""}
      value={words}
      onChange={(chosen) => set(chosen.length === 0 && !required ? undefined : chosen)}
    />
  );
}

export function OneText(props: FieldProps) {
  const { value, fallback, label, help, problem, set, required, builder } = useField(props);
  const offered = suggestionsFor(builder.data, props.path);
  const common = {
    label,
    description: help,
    error: problem,
    required,
    placeholder: shown(fallback),
    value: typeof value === "string" ? value : "",
  };
  const change = (text: string) => set(text === "" && !required ? undefined : text);
  if (offered.length > 0) return <Autocomplete {...common} classNames={NARROW} data={[...new Set(offered)]} onChange={change} />;
  return <TextInput {...common} onChange={(event) => change(event.currentTarget.value)} />;
}

/** The same text in each language of the study. */
export function Translated(props: FieldProps) {
  const { value, fallback, label, help, problem, set, required, builder } = useField(props);
  const texts = isTable(value) ? value : {};
  return (
    <SimpleGrid cols={{ base: 1, sm: Math.min(2, builder.languages.length) }} spacing="xs" verticalSpacing={4}>
      {builder.languages.map((language, index) => (
        <Textarea
          key={language}
          label={builder.languages.length > 1 ? `${label}, ${languageName(language)}` : label}
          description={help}
          error={index === 0 ? problem : null}
          required={required}
          autosize
          minRows={1}
          maxRows={8}
          placeholder={textAt(fallback, [language])}
          value={textAt(texts, [language])}
          onChange={(event) => {
            const text = event.currentTarget.value;
            const next = withValue(texts, [language], text === "" && !required ? undefined : text);
            set(isTable(next) && Object.keys(next).length === 0 ? undefined : next);
          }}
        />
      ))}
    </SimpleGrid>
  );
}

/** Lists of words: one list per line, words separated by commas. */
export function Lists(props: FieldProps) {
  const { value, label, help, problem, set } = useField(props);
  const lists = Array.isArray(value) ? (value as unknown[][]) : [];
  const [text, setText] = useState(() => lists.map((list) => list.join(", ")).join("\n"));
  return (
    <Textarea
      label={label}
      description={`${help} One list per line, words separated by commas.`}
      error={problem}
      className="editor"
      autosize
      minRows={2}
      maxRows={12}
      value={text}
      onChange={(event) => {
        setText(event.currentTarget.value);
        const lines = event.currentTarget.value.split("\n").map((line) =>
          line
            .split(",")
            .map((word) => word.trim())
            .filter((word) => word !== ""),
        );
        const filled = lines.filter((line) => line.length > 0);
        set(filled.length === 0 ? undefined : filled);
      }}
    />
  );
}

/** Any value, as JSON: for keys without a special editor. */
export function Raw(props: FieldProps) {
  const { value, label, help, problem, set } = useField(props);
  const [text, setText] = useState(() => (value === undefined ? "" : JSON.stringify(value, null, 2)));
  return (
    <JsonInput
      label={label}
      description={`${help} Enter as JSON.`}
      error={problem}
      autosize
      minRows={2}
      maxRows={12}
      validationError="This is not valid JSON."
      value={text}
      onChange={(entered) => {
        setText(entered);
        try {
          set(entered.trim() === "" ? undefined : JSON.parse(entered));
        } catch {
          // Not complete yet: the declaration keeps what it has.
        }
      }}
    />
  );
}
