/** Editors that take an element a line. */

import { Stack, Textarea } from "@mantine/core";
import { useState } from "react";
import { languageName } from "../../ui/format";
import { type Data, isTable, textAt } from "../data";
import { editorOf } from "../schema";
import { type FieldProps, useField } from "./useField";

/** Texts in an order, each in every language: a line a text. */
export function Translations(props: FieldProps) {
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
    <Stack gap={4}>
      {builder.languages.map((language, index) => (
        <Textarea
          key={language}
          label={builder.languages.length > 1 ? `${label}, ${languageName(language)}` : label}
          description={index === 0 ? `${help} Here: one a line.` : undefined}
          error={index === 0 ? problem : null}
          autosize
          minRows={2}
          maxRows={12}
          value={texts.map((text) => textAt(text, [language])).join("\n")}
          onChange={(event) => change(language, event.currentTarget.value)}
        />
      ))}
    </Stack>
  );
}

/** Numbers in an order: one a line. What is no number stays out until it is one. */
export function Numbers(props: FieldProps) {
  const { value, label, help, problem, set } = useField(props);
  const [text, setText] = useState(() => (Array.isArray(value) ? value.map(String).join("\n") : ""));
  return (
    <Textarea
      label={label}
      description={`${help} Here: one a line.`}
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

/** Words that stand for words or numbers: `key = value`, one a line. */
export function Dictionary(props: FieldProps) {
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
      description={`${help} Here: key = value, one a line.`}
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
