/** The declaration's JSON schema, and which editor a key of it gets. */

import declared from "../../api/declaration.json";
import { labelOf, NAMED, type Section } from "./data";

export interface Schema {
  $ref?: string;
  type?: string;
  title?: string;
  description?: string;
  default?: unknown;
  const?: unknown;
  enum?: string[];
  properties?: Record<string, Schema>;
  patternProperties?: Record<string, Schema>;
  additionalProperties?: Schema;
  required?: string[];
  items?: Schema;
  anyOf?: Schema[];
  oneOf?: Schema[];
  discriminator?: { propertyName: string; mapping: Record<string, string> };
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  minItems?: number;
  maxItems?: number;
  $defs?: Record<string, Schema>;
}

export const EXPERIMENT = declared.schema as unknown as Schema;

type Effect = "wording" | "measured";
const EFFECTS = declared.effects as Record<string, Effect>;
const TRIAL_EFFECTS = declared.trial_effects as Record<string, Record<string, Effect>>;

/** The schema that a reference points to; keys next to the reference (help, default) take precedence. */
export function resolved(schema: Schema): Schema {
  if (schema.$ref === undefined) return schema;
  const name = schema.$ref.replace("#/$defs/", "");
  const whole = { ...EXPERIMENT.$defs?.[name], ...schema };
  delete whole.$ref;
  return whole;
}

export type Editor =
  | { kind: "constant" }
  | { kind: "flag" }
  | { kind: "number"; whole: boolean; minimum?: number | undefined; maximum?: number | undefined }
  | { kind: "choice"; options: string[] }
  | { kind: "text" }
  | { kind: "translated" }
  | { kind: "words" }
  | { kind: "numbers" }
  | { kind: "lists" }
  | { kind: "translations" }
  | { kind: "dictionary"; of: "text" | "number" }
  | { kind: "table"; keys: [name: string, schema: Schema][]; required: string[] }
  | { kind: "variants"; tag: string; variants: Record<string, Schema> }
  | { kind: "elements"; of: Schema; atLeast: number }
  | { kind: "languages"; of: Schema }
  | { kind: "raw" };

/** The editor of a key; `raw` takes any value as JSON where there is no better one. */
export function editorOf(given: Schema): Editor {
  const schema = withoutNull(resolved(given));
  if (schema.const !== undefined) return { kind: "constant" };
  if (schema.enum !== undefined) return { kind: "choice", options: schema.enum };
  if (schema.discriminator !== undefined) return variantsOf(schema.discriminator);
  switch (schema.type) {
    case "boolean":
      return { kind: "flag" };
    case "integer":
    case "number":
      return {
        kind: "number",
        whole: schema.type === "integer",
        minimum: schema.minimum ?? schema.exclusiveMinimum,
        maximum: schema.maximum,
      };
    case "string":
      return { kind: "text" };
    case "array":
      return listEditor(schema);
    case "object":
      return tableEditor(schema);
    default:
      return { kind: "raw" };
  }
}

function variantsOf({ propertyName, mapping }: NonNullable<Schema["discriminator"]>): Editor {
  const variants = Object.fromEntries(Object.entries(mapping).map(([tag, $ref]) => [tag, resolved({ $ref })]));
  return { kind: "variants", tag: propertyName, variants };
}

function listEditor(schema: Schema): Editor {
  const items = withoutNull(resolved(schema.items ?? {}));
  if (items.type === "string") return { kind: "words" };
  if (items.type === "number" || items.type === "integer") return { kind: "numbers" };
  if (items.type === "array" && withoutNull(resolved(items.items ?? {})).type === "string") return { kind: "lists" };
  const inner = editorOf(items).kind;
  if (inner === "translated") return { kind: "translations" };
  return inner === "table" || inner === "variants" ? { kind: "elements", of: items, atLeast: schema.minItems ?? 0 } : { kind: "raw" };
}

function tableEditor(schema: Schema): Editor {
  if (schema.properties !== undefined) return { kind: "table", keys: Object.entries(schema.properties), required: schema.required ?? [] };
  if (schema.additionalProperties?.type === "string") return { kind: "dictionary", of: "text" };
  const [inner] = Object.values(schema.patternProperties ?? {});
  if (inner === undefined) return { kind: "raw" };
  const { type } = resolved(inner);
  if (type === "integer" || type === "number") return { kind: "dictionary", of: "number" };
  return type === "string" ? { kind: "translated" } : { kind: "languages", of: resolved(inner) };
}

/** A key that may be left out altogether (`X | None`): its schema without the null. */
export function withoutNull(schema: Schema): Schema {
  const others = schema.anyOf?.filter((one) => one.type !== "null");
  if (others?.length !== 1 || others[0] === undefined) return schema;
  const whole = { ...resolved(others[0]), ...schema };
  delete whole.anyOf;
  return whole;
}

export function mayBeNull(schema: Schema): boolean {
  return resolved(schema).anyOf?.some((one) => one.type === "null") ?? false;
}

/** The value that a new key begins with: what is required, empty where nothing else is known. */
export function starter(given: Schema, languages: readonly string[]): unknown {
  const schema = resolved(given);
  if (schema.default !== undefined && schema.default !== null) return schema.default;
  const editor = editorOf(schema);
  switch (editor.kind) {
    case "constant":
      return schema.const;
    case "flag":
      return false;
    case "number":
      return Math.max(1, schema.minimum ?? 1);
    case "choice":
      return editor.options[0];
    case "text":
      return "";
    case "translated":
      return Object.fromEntries(languages.map((language) => [language, ""]));
    case "languages":
      return Object.fromEntries(languages.map((language) => [language, starter(editor.of, languages)]));
    case "table":
      return starterTable(editor, languages);
    case "variants":
      return starterOf(editor, Object.keys(editor.variants)[0] ?? "", languages);
    case "elements":
      return Array.from({ length: editor.atLeast }, () => starter(editor.of, languages));
    case "words":
    case "numbers":
    case "lists":
    case "translations":
      return [];
    case "dictionary":
      return {};
    case "raw":
      return null;
  }
}

function starterTable({ keys, required }: Extract<Editor, { kind: "table" }>, languages: readonly string[]): Record<string, unknown> {
  const needed = keys.filter(([name, schema]) => required.includes(name) || editorOf(schema).kind === "constant");
  return Object.fromEntries(needed.map(([name, schema]) => [name, starter(schema, languages)]));
}

/** A member of a union with its tag and what else it requires; `before` gives the keys that both have. */
export function starterOf(
  { tag, variants }: Extract<Editor, { kind: "variants" }>,
  chosen: string,
  languages: readonly string[],
  before: Record<string, unknown> = {},
): Record<string, unknown> {
  const schema = variants[chosen] ?? {};
  const fresh = starter(schema, languages) as Record<string, unknown>;
  const kept = Object.entries(before).filter(([key]) => key !== tag && key in (schema.properties ?? {}));
  return { [tag]: chosen, ...fresh, ...Object.fromEntries(kept), ...{ [tag]: chosen } };
}

/** What an edit of the key at this path (without list numbers) does to answers that are there. */
export function effectOf(path: string, trialKind: string): Effect | null {
  for (let at = path; at !== ""; at = at.slice(0, Math.max(0, at.lastIndexOf(".")))) {
    const effect = EFFECTS[at] ?? (at.startsWith("trial.") ? TRIAL_EFFECTS[trialKind]?.[at.slice(6)] : undefined);
    if (effect !== undefined) return effect;
    if (at === "trial.kind") return "measured";
  }
  return null;
}

// Help in the words of the page: the declaration's own texts name keys of the TOML, the forms show labels.

const KEYS = new Set([EXPERIMENT, ...Object.values(EXPERIMENT.$defs ?? {})].flatMap((table) => Object.keys(table.properties ?? {})));
const VALUES = new Set(Object.values(EXPERIMENT.$defs ?? {}).flatMap(valuesIn));
/** The families of keys that playback's help speaks of at once. */
const FAMILY = /`([a-z]+)_\*`/g;

function valuesIn(schema: Schema): string[] {
  return Object.values(schema.properties ?? {}).flatMap((key) => [
    ...(key.enum ?? []),
    ...(typeof key.const === "string" ? [key.const] : []),
  ]);
}

const quoted = (words: string) => `“${words}”`;
const inWords = (value: string) => value.replaceAll("_", " ");

/** `pointer_delay_ms` reads “Pointer delay (ms)”, [[trial.scales]] “Scales”, `start = "fixation"` “Start” is “fixation”. */
export function helpOf(schema: Schema): string {
  return (schema.description ?? "")
    .replaceAll(/`(\w+) = "?([\w ]+)"?`/g, (_, key: string, value: string) => `${quoted(labelOf(key))} is ${quoted(inWords(value))}`)
    .replaceAll(/\[+([a-z]\w*(?:\.\w+)*)\]+/g, (_, path: string) =>
      quoted(labelOf(path.split(".").findLast((part) => KEYS.has(part)) ?? path)),
    )
    .replaceAll(FAMILY, (_, stem: string) => quoted(`${labelOf(stem)} …`))
    .replaceAll(/`(\w+)`/g, (_, word: string) => (VALUES.has(word) ? inWords(word) : KEYS.has(word) ? quoted(labelOf(word)) : word))
    .replaceAll(/”\s+“/g, ", ")
    .replaceAll("`", "")
    .replaceAll(/\s+/g, " ")
    .trim();
}

// The keys that every study decides; others are under "More" until they are set.

export const BASIC = new Set([
  "factors.levels",
  "factors.between",
  "render.character",
  "render.profile",
  "practice.trials",
  "blocks.split_by",
  "blocks.order",
  "blocks.repeats",
  "groups.by",
  "attention.per_block",
  "evidence.online_recruitment",
  "display.calibrate",
  "display.minimum_width_px",
  "display.minimum_height_px",
  "session.resume",
  "forms.when",
  "forms.fields",
  "forms.fields.required",
  "forms.fields.options",
  "forms.fields.minimum",
  "forms.fields.maximum",
  "retention.identifiers_days",
  "retention.answers_days",
  "dataset.licence",
  "analysis.statistic",
]);
/** Keys of every scale, anywhere in a trial. */
const OF_SCALES = /^trial\.(?:.*\.)?scales?\.(?:minimum|maximum|question|low|high)$/;
/** Under "More" even where they are set: what is derived from words that participants read, and fine points of a trial. */
export const TUCKED = new Set([
  "forms.name",
  "forms.fields.name",
  "trial.expected_seconds",
  "trial.ahead",
  "trial.function",
  "trial.direction",
  "trial.fixation_ms",
  "trial.pointer_delay_ms",
]);

/** Whether a key is shown before anybody opens "More". */
export function isBasic(path: string, isRequired: boolean): boolean {
  return !TUCKED.has(path) && (isRequired || BASIC.has(path) || OF_SCALES.test(path));
}

// The pages of the builder, with those that the declaration's schema adds.

const placed = new Set(NAMED.flatMap((section) => section.keys));
const further = Object.keys(EXPERIMENT.properties ?? {}).filter((key) => !placed.has(key));

/** Every key of the declaration is on one of these pages; a key that none names is on the last. */
export const SECTIONS: readonly Section[] = [
  ...NAMED,
  ...(further.length > 0 ? [{ id: "further", label: "Further", about: "Other keys of the declaration.", keys: further }] : []),
];

/** The page on which the key at the beginning of a path is edited. */
export function sectionOf(path: string): Section | undefined {
  const [key = ""] = path.split(".");
  return SECTIONS.find((section) => section.keys.includes(key));
}
