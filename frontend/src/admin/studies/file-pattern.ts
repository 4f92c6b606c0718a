/** What a pattern such as `{speed}_{exemplar}.mp4` reads from the names of files, as the server reads them. */

import reservedNames from "../../api/reserved-names.json";

const FIELD = /\{([A-Za-z]\w*)\}/g;
/** Names that the server gives where levels do not give one away. */
const NUMBERED = /^factor\d+$/;
const EXEMPLAR = "exemplar";

export interface FileLevels {
  file: string;
  /** The text in the place of each field; null where the name does not fit. */
  levels: string[] | null;
}

/** Files of several formats follow one pattern. */
const stemOf = (name: string) => name.replace(/\.[A-Za-z0-9]{1,4}$/, "");

export const fieldsOf = (pattern: string) => [...pattern.matchAll(FIELD)].map((match) => match[1] ?? "");

/** Every file with its levels; those that do not fit come first. */
export function levelsByPattern(pattern: string, files: readonly string[]): FileLevels[] {
  const source = stemOf(pattern.normalize("NFC"))
    .split(/\{[A-Za-z]\w*\}/)
    .map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"))
    .join("([^/]+?)");
  const matcher = new RegExp(`^${source}$`);
  return files
    .map((file) => ({ file, levels: matcher.exec(stemOf(file.normalize("NFC")))?.slice(1) ?? null }))
    .sort((a, b) => Number(a.levels !== null) - Number(b.levels !== null));
}

const RESERVED: ReadonlySet<string> = new Set(reservedNames.filter((name) => name !== EXEMPLAR));

/** What to do about a factor that has the name of another column of the answers; false where none has. */
export function reservedProblem(factors: readonly string[], others: readonly string[] = []): string | false {
  const name = factors.find((one) => RESERVED.has(one) || others.includes(one));
  return name !== undefined && `a factor name other than ‘${name}’ (a column of the answers), such as ${name}_shown`;
}

/** The factors of a table of levels, as its header names them. */
export function factorsOfTable(csv: string): string[] {
  const [header = ""] = csv.replace(/^\uFEFF/, "").split(/\r?\n/);
  const separator = [",", ";", "\t"].reduce((best, sign) => (header.split(sign).length > header.split(best).length ? sign : best));
  return header.split(separator).map((name) => name.trim().replaceAll(/^"|"$/g, ""));
}

/** What a pattern lacks before a study can be made by it; false where nothing. */
export function patternProblem(pattern: string, files: readonly string[]): string | false {
  if (fieldsOf(pattern).every((field) => field === EXEMPLAR)) return "a pattern with the name of a factor in braces, such as {speed}";
  const reserved = reservedProblem(fieldsOf(pattern));
  if (reserved !== false) return reserved;
  const strays = levelsByPattern(pattern, files).filter(({ levels }) => levels === null);
  return strays.length > 0 && `a pattern that every file name fits (${strays[0]?.file ?? ""} does not), or a table`;
}

interface Declared {
  name: string;
  levels: readonly { name: string }[];
}

/** The pattern by which these names are the study's own levels, where one is plain: a single clip gives no other hint. */
export function declaredPattern(factors: readonly Declared[], files: readonly string[]): string {
  const known = factors.map(({ levels }) => new Set(levels.map(({ name }) => name)));
  const fits = (pattern: string) =>
    levelsByPattern(pattern, files).every(({ levels }) => levels !== null && known.every((names, index) => names.has(levels[index] ?? "")));
  const fields = factors.map(({ name }) => `{${name}}`);
  const tried = ["_", "-"].flatMap((sign) => [[...fields, `{${EXEMPLAR}}`].join(sign), fields.join(sign)]);
  return files.length === 0 ? "" : (tried.map((stem) => `${stem}.mp4`).find(fits) ?? "");
}

export interface Unnamed {
  field: string;
  levels: string[];
}

const MIN_NUMBERS = 4;

/** What a threshold along a factor lacks, of the levels of each factor; false where one has enough numbers. */
export function numbersProblem(levels: readonly (readonly string[])[]): string | false {
  const isNumber = (level: string) => level.trim() !== "" && Number.isFinite(Number(level));
  const fits = levels.some((of) => of.every(isNumber) && new Set(of.map(Number)).size >= MIN_NUMBERS);
  return !fits && `a factor with at least ${MIN_NUMBERS} levels that are all numbers, such as 50, 75, 100, 150`;
}

/** The levels that a pattern reads for each factor. */
export function levelsOfPattern(pattern: string, files: readonly string[]): string[][] {
  const read = levelsByPattern(pattern, files);
  return fieldsOf(pattern)
    .map((field, position) => (field === EXEMPLAR ? [] : [...new Set(read.flatMap(({ levels }) => levels?.[position] ?? []))]))
    .filter((levels) => levels.length > 0);
}

/** Counters have gaps where clips were deleted, but no more than this per clip. */
const MAX_STEP = 4;

/** Whether names only number the clips, such as IMG_4031 and IMG_4032: no factor is in them. */
export function saysNothing(pattern: string, files: readonly string[]): boolean {
  const named = fieldsOf(pattern).filter((field) => field !== EXEMPLAR);
  const [unnamed] = unnamedFactors(pattern, files);
  if (named.length !== 1 || unnamed === undefined) return named.length === 0;
  const numbers = unnamed.levels.map((level) => (/^\d+$/.test(level) ? Number(level) : Number.NaN));
  const isCounter = Math.max(...numbers) - Math.min(...numbers) <= MAX_STEP * numbers.length;
  return files.length > 1 && numbers.length === files.length && isCounter;
}

/** The factors whose names say nothing, each with its levels: somebody has to say what they are. */
export function unnamedFactors(pattern: string, files: readonly string[]): Unnamed[] {
  const read = levelsByPattern(pattern, files);
  return fieldsOf(pattern).flatMap((field, position) =>
    NUMBERED.test(field) ? [{ field, levels: [...new Set(read.flatMap(({ levels }) => levels?.[position] ?? []))] }] : [],
  );
}

/** The pattern with factors called as somebody said; a name that is none, or is taken, leaves it as it is. */
export function withNames(pattern: string, names: Readonly<Record<string, string>>): string {
  const given = new Map<string, string>();
  for (const field of fieldsOf(pattern)) {
    const name = Object.hasOwn(names, field) ? factorName(names[field] ?? "") : "";
    const taken = [...fieldsOf(pattern), ...given.values(), EXEMPLAR];
    if (name !== "" && !taken.includes(name)) given.set(field, name);
  }
  return pattern.replaceAll(FIELD, (whole, field: string) => (given.has(field) ? `{${given.get(field) ?? ""}}` : whole));
}

/** "Robot type" is called `Robot_type`; letters beyond ASCII lose their marks. */
export function factorName(words: string): string {
  const plain = words
    .replaceAll("ß", "ss")
    .normalize("NFD")
    .replaceAll(/\p{M}/gu, "")
    .replaceAll(/\W+/g, "_")
    .replaceAll(/^[\d_]+|_+$/g, "");
  return plain.slice(0, 40);
}
