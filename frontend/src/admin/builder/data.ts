/** A declaration as plain data, changed without changing what was there before. */

import { languageName, words } from "../ui/format";

export type Path = readonly (string | number)[];
export type Data = Record<string, unknown>;

export function isTable(value: unknown): value is Data {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

export function valueAt(data: unknown, path: Path): unknown {
  let value = data;
  for (const part of path) {
    if (Array.isArray(value)) value = (value as unknown[])[Number(part)];
    else if (isTable(value)) value = value[part];
    else return undefined;
  }
  return value;
}

export function listAt(data: unknown, path: Path): unknown[] {
  const value = valueAt(data, path);
  return Array.isArray(value) ? (value as unknown[]) : [];
}

export function tableAt(data: unknown, path: Path): Data {
  const value = valueAt(data, path);
  return isTable(value) ? value : {};
}

export function textAt(data: unknown, path: Path): string {
  const value = valueAt(data, path);
  return typeof value === "string" ? value : "";
}

/** `data` with another value at `path`; undefined removes the key, and tables on the way are made. */
export function withValue(data: unknown, path: Path, value: unknown): unknown {
  const [part, ...rest] = path;
  if (part === undefined) return value;
  const inner = withValue(valueAt(data, [part]), rest, value);
  if (Array.isArray(data)) {
    const list = [...(data as unknown[])];
    if (inner === undefined) list.splice(Number(part), 1);
    else list[Number(part)] = inner;
    return list;
  }
  const table = isTable(data) ? { ...data } : {};
  if (inner === undefined) Reflect.deleteProperty(table, part);
  else table[part] = inner;
  return table;
}

export function withMoved(list: readonly unknown[], from: number, to: number): unknown[] {
  const moved = [...list];
  const [element] = moved.splice(from, 1);
  moved.splice(Math.min(list.length - 1, Math.max(0, to)), 0, element);
  return moved;
}

/** As the server names places: elements are counted from 1. */
export function pathName(path: Path): string {
  return path.map((part) => (typeof part === "number" ? part + 1 : part)).join(".");
}

/** As the table of effects names keys: without the numbers of elements, languages and members. */
export function keyName(path: Path): string {
  return path.filter((part) => typeof part === "string").join(".");
}

const UNITS: Record<string, string> = { ms: "ms", mm: "mm", px: "px", hours: "hours", minutes: "minutes", seconds: "seconds" };

/** "failed_longest_gap_ms" reads "Failed longest gap (ms)". */
export function labelOf(key: string): string {
  // "break_seconds_min" is a least number of seconds, but its unit comes before the "min".
  const parts = key.replace(/^(.*)_seconds_min$/, "shortest_$1_seconds").split("_");
  const last = parts.at(-1) ?? "";
  const unit = parts.length > 1 ? UNITS[last] : undefined;
  const words = (unit === undefined ? parts : parts.slice(0, -1)).join(" ");
  return `${words.charAt(0).toUpperCase()}${words.slice(1)}${unit === undefined ? "" : ` (${unit})`}`;
}

const IRREGULAR: Record<string, string> = { series: "series", stimuli: "stimulus" };

// Places of a declaration in words.

const NOUNS: Readonly<Record<string, string>> = {
  factors: "factor",
  levels: "level",
  forms: "questionnaire",
  fields: "question",
  options: "answer",
  scales: "scale",
  series: "series",
  screening: "screening rule",
  exclusions: "exclusion rule",
  rules: "rule",
};
/** The values at a path, the innermost first. */
export function placeOf([part = "", name, ...rest]: string[]): string {
  if (part === "texts" && name !== undefined) return `the text “${labelOf(rest.join(" "))}” in ${languageName(name)}`;
  const noun = NOUNS[part];
  const [here, inner] =
    noun !== undefined && name !== undefined
      ? [`the ${noun} ${words(name)}`, rest]
      : [`“${labelOf(part)}”`, name === undefined ? [] : [name, ...rest]];
  return inner.length === 0 ? here : `${placeOf(inner)} of ${here}`;
}

/** As `placeOf`, at the beginning of a line. */
export function placeTitle(path: string[]): string {
  const name = placeOf(path);
  return `${name.charAt(0).toUpperCase()}${name.slice(1)}`;
}

/** One of several: "factors" are made of factors, "categories" of categories, and a series is one of "series". */
export function singularOf(plural: string): string {
  const words = plural.split(" ");
  const last = words.pop() ?? "";
  const one = IRREGULAR[last] ?? (last.endsWith("ies") ? `${last.slice(0, -3)}y` : last.endsWith("ss") ? last : last.replace(/s$/, ""));
  return [...words, one].join(" ");
}

/** A name that none of `taken` has: "factor_2" after "factor". */
export function freeName(stem: string, taken: readonly string[]): string {
  if (!taken.includes(stem)) return stem;
  let number = 2;
  while (taken.includes(`${stem}_${number}`)) number += 1;
  return `${stem}_${number}`;
}

// Names and stored values of questions and answers, which follow from what participants read.

/** Names that a question, an answer or a questionnaire gets before it has words. */
const UNNAMED = /^(?:name|form|field|option|value|choice|question)(?:_\d+)?$/;

/** "I would rather not say" is stored as "i_would_rather_not_say"; letters beyond ASCII lose their marks. */
export function storedName(words: string): string {
  return words
    .replaceAll("ß", "ss")
    .normalize("NFD")
    .replaceAll(/\p{M}/gu, "")
    .toLowerCase()
    .replaceAll(/[^a-z0-9]+/g, "_")
    .replaceAll(/^[\d_]+|_+$/g, "")
    .slice(0, 40);
}

/**
 * `data` with another value at `path`, and with the name that follows from it where the path is what a questionnaire, a
 * question or an answer is called. A name that somebody chose stays, and so does one that is stored: answers have it.
 */
export function withDerivedName(data: Data, saved: unknown, path: Path, value: unknown): Data {
  const next = withValue(data, path, value) as Data;
  const at = path.findIndex((part) => part === "label" || part === "title");
  if (path[0] !== "forms" || at < 0 || typeof path[at - 1] !== "number") return next;
  const [element, list] = [path.slice(0, at), path.slice(0, at - 1)];
  const key = valueAt(next, [...element, "value"]) === undefined ? "name" : "value";
  const name = textAt(next, [...element, key]);
  const words = (of: Data) => firstText(valueAt(of, path.slice(0, at + 1)));
  const isFree = UNNAMED.test(name) || name === "" || name === storedName(words(data));
  const isStored = listAt(saved, list).some((one) => textAt(one, [key]) === name);
  const derived = storedName(words(next));
  if (!isFree || isStored || derived === "") return next;
  const others = listAt(next, list).filter((_, index) => index !== path[at - 1]);
  const taken = others.map((other) => textAt(other, [key]));
  return withValue(next, [...element, key], freeName(derived, taken)) as Data;
}

/** A text, or the first of its languages. */
function firstText(value: unknown): string {
  if (typeof value === "string") return value;
  return isTable(value) ? textAt(value, [Object.keys(value)[0] ?? ""]) : "";
}

// Values that a key of text may well take, from what is declared elsewhere: names of factors, forms, cells.

const KNOWN: Record<string, string[]> = {
  languages: ["en", "de"],
  "render.character": [
    "alder@8",
    "alder@11",
    "birch@6",
    "birch@9",
    "cedar@4",
    "cedar@7",
    "hazel@7",
    "cartoon",
    "cartoon@2",
    "cartoon-willow",
  ],
  "render.profile": ["real", "phases", "model", "SL", "AL", "SL_ease", "AL_ease"],
};
const FACTORS = ["exemplars.own_per", "blocks.split_by", "analysis.factors", "analysis.pairs", "trial.pairs.factor"];
const CELLS = ["trial.reference.cell", "trial.pairs.cells.cell", "trial.pairs.cells.other"];

/** Keys that name a level, each with the key that names its factor. */
const LEVEL_OF: Record<string, Path> = {
  "trial.task.standard": ["trial", "stimulus", "factor"],
  "trial.reference.level": ["trial", "reference", "factor"],
};

function levelNames(data: Data, factor: string): string[] {
  return namesOf(
    listAt(
      listAt(data, ["factors"]).find((one) => textAt(one, ["name"]) === factor),
      ["levels"],
    ),
  );
}

/** A table that begins: where it must name a factor, the first one. */
export function withFirstFactor(data: Data, path: Path, table: Data): Data {
  const [first] = factorNames(data);
  const isOpen = table["factor"] === "" && suggestionsFor(data, [...path, "factor"]).length > 0;
  return isOpen && first !== undefined ? { ...table, factor: first } : table;
}

function namesOf(elements: readonly unknown[]): string[] {
  return elements.map((element) => textAt(element, ["name"])).filter((name) => name !== "");
}

function factorNames(data: Data): string[] {
  return namesOf(listAt(data, ["factors"]));
}

/** Names of the cells: every level with every other, as the design names them. */
function cellNames(data: Data): string[] {
  const levels = listAt(data, ["factors"]).map((factor) => namesOf(listAt(factor, ["levels"])));
  return levels.reduce<string[]>(
    (cells, names) => cells.flatMap((cell) => names.map((name) => (cell === "" ? name : `${cell}/${name}`))).slice(0, 500),
    [""],
  );
}

/** What may be offered at this place; empty where anything goes. */
export function suggestionsFor(data: Data, path: Path): string[] {
  const key = keyName(path);
  const end = KNOWN[key] ?? KNOWN[key.replace(/^factors\.levels\./, "")];
  if (end !== undefined) return end;
  if (FACTORS.includes(key) || key.endsWith(".factor") || key.endsWith(".factors")) return factorNames(data);
  if (CELLS.includes(key)) return cellNames(data);
  if (LEVEL_OF[key] !== undefined) return levelNames(data, textAt(data, LEVEL_OF[key]));
  if (key.startsWith("screening.")) return ofForms(data, key, path.slice(0, 2));
  return [];
}

function ofForms(data: Data, key: string, rule: Path): string[] {
  const forms = listAt(data, ["forms"]);
  if (key === "screening.form") return namesOf(forms);
  const chosen = tableAt(data, rule);
  const fields = listAt(
    forms.find((form) => textAt(form, ["name"]) === chosen["form"]),
    ["fields"],
  );
  if (key === "screening.field") return namesOf(fields);
  const field = fields.find((one) => textAt(one, ["name"]) === chosen["field"]);
  return key === "screening.refused" ? listAt(field, ["options"]).map((option) => textAt(option, ["value"])) : [];
}

// The pages of the builder, and the keys of the declaration on each.

export interface Section {
  id: string;
  label: string;
  about: string;
  keys: readonly string[];
}

export const NAMED: readonly Section[] = [
  {
    id: "study",
    label: "Study",
    about: "What the study is called, where it comes from, and in which languages people may take part.",
    keys: ["name", "title", "participant_title", "source", "version", "participants", "languages"],
  },
  {
    id: "factors",
    label: "Factors and clips",
    about:
      "The factors and their levels form the cells of the design. Each cell has as many clips as exemplars. Tables and figures keep this order.",
    keys: ["factors", "exemplars", "render"],
  },
  { id: "trial", label: "Trial", about: "What a trial shows and asks.", keys: ["trial"] },
  {
    id: "order",
    label: "Practice and order",
    about: "Practice, blocks, counterbalancing, and who sees which clips.",
    keys: ["practice", "blocks", "assignment", "groups"],
  },
  {
    id: "forms",
    label: "Questionnaires",
    about: "Pages of questions before and after the trials. Answers become columns of the runs.",
    keys: ["forms"],
  },
  { id: "texts", label: "Texts", about: "The pages that participants read, in Markdown, in each language.", keys: ["texts"] },
  {
    id: "screen",
    label: "Screen and playback",
    about: "Size and background of the clips, device requirements, and when a play counts.",
    keys: ["display", "playback", "session"],
  },
  {
    id: "rules",
    label: "Checks and exclusions",
    about: "Attention and motion checks, screening, warnings, and exclusions from the analysis.",
    keys: ["attention", "evidence", "screening", "warnings", "exclusions"],
  },
  { id: "analysis", label: "Analysis", about: "The analysis plan, fixed before data collection.", keys: ["analysis"] },
  {
    id: "dataset",
    label: "Retention and sharing",
    about: "How long personal data are kept, and the license for shared data.",
    keys: ["retention", "dataset"],
  },
];

/** The page on which the key at the beginning of a path is edited, of those that have a name. */
export function namedSection(path: string): Section | undefined {
  const [key = ""] = path.split(".");
  return NAMED.find((section) => section.keys.includes(key));
}
