/** Which clip is in which cell of a study of own clips: moved, swapped, filled from file names, kept when levels are renamed. */

import type { Schemas } from "../api";
import { factorName, fieldsOf, levelsByPattern, reservedProblem } from "../studies/file-pattern";
import { type Data, isTable, listAt, tableAt, textAt, withValue } from "./data";

/** A clip with its cell; the exemplar is 0 while it is in none. */
export interface Place {
  clip_sha256: string;
  file: string;
  levels: Record<string, string>;
  exemplar: number;
  /** The upload that it comes from; null for a clip of the study. */
  upload: string | null;
  /** Where the version that the work began from has it. */
  from?: Pick<Place, "levels" | "exemplar">;
}

/** A place in a cell that one clip fills. */
export interface Slot {
  levels: Record<string, string>;
  exemplar: number;
  /** "rosie/slow, no. 1" */
  name: string;
}

interface Factor {
  name: string;
  levels: string[];
}

export const isClip = (one: Place, other: Place) => one.clip_sha256 === other.clip_sha256 && one.file === other.file;
/** The level of a factor; "" where none is known. Every object has `constructor` and others, which a factor may be called. */
const levelOf = (levels: Readonly<Record<string, string>>, factor: string) => (Object.hasOwn(levels, factor) ? (levels[factor] ?? "") : "");
const addressOf = (levels: Readonly<Record<string, string>>, exemplar: number, factors: readonly Factor[]) =>
  JSON.stringify([...factors.map(({ name }) => levelOf(levels, name)), exemplar]);

export function storedPlaces(clips: readonly Schemas["ClipOut"][]): Place[] {
  return clips.map(({ clip_sha256, file, levels, exemplar }) => ({
    clip_sha256,
    file,
    levels,
    exemplar,
    upload: null,
    from: { levels, exemplar },
  }));
}

/** The clips of an upload that can be used, each in no cell. */
export function uploadedPlaces({ id, files }: Pick<Schemas["UploadOut"], "id" | "files">): Place[] {
  return files.flatMap(({ name, sha256, state }): Place[] =>
    state !== "ready" || sha256 == null ? [] : [{ clip_sha256: sha256, file: name, levels: {}, exemplar: 0, upload: id }],
  );
}

export function factorsOf(data: Data): Factor[] {
  return listAt(data, ["factors"]).map((factor) => ({
    name: textAt(factor, ["name"]),
    levels: listAt(factor, ["levels"]).map((level) => textAt(level, ["name"])),
  }));
}

/** The server's limits. */
const [MAX_SLOTS, MAX_PER_CELL] = [5_000, 1_000];

/** Every place of the design, in the order of its cells: the last factor changes fastest. */
export function slotsOf(data: Data): Slot[] {
  const factors = factorsOf(data);
  if (factors.length === 0) return [];
  const perCell = Math.min(Math.max(1, Number(tableAt(data, ["exemplars"])["per_cell"] ?? 1) || 1), MAX_PER_CELL);
  let cells: Record<string, string>[] = [{}];
  for (const { name, levels } of factors)
    cells = cells.flatMap((cell) => levels.map((level) => ({ ...cell, [name]: level }))).slice(0, Math.ceil(MAX_SLOTS / perCell));
  const slots = cells.flatMap((levels) =>
    Array.from({ length: perCell }, (_, index) => ({
      levels,
      exemplar: index + 1,
      name: `${factors.map(({ name }) => levels[name] ?? "").join("/")}, no. ${String(index + 1)}`,
    })),
  );
  return slots.slice(0, MAX_SLOTS);
}

export interface Arrangement {
  /** Each place of the design with its clip; null where it is empty. */
  filled: { slot: Slot; clip: Place | null }[];
  /** Clips that are in no cell. */
  rest: Place[];
}

/** Clips in the places of the design; of two for one place the first is in it. */
export function arrangementOf(places: readonly Place[], data: Data): Arrangement {
  const factors = factorsOf(data);
  const byAddress = new Map<string, Place>();
  for (const member of places) {
    const address = addressOf(member.levels, member.exemplar, factors);
    if (!byAddress.has(address)) byAddress.set(address, member);
  }
  const filled = slotsOf(data).map((slot) => ({ slot, clip: byAddress.get(addressOf(slot.levels, slot.exemplar, factors)) ?? null }));
  const inCells = new Set(filled.map(({ clip }) => clip));
  return { filled, rest: places.filter((member) => !inCells.has(member)) };
}

/** What is sent: the clips that are in cells, with the levels of the design's factors alone. */
export function placesToSave(places: readonly Place[], data: Data): Schemas["PlacedClip"][] {
  return arrangementOf(places, data).filled.flatMap(({ slot, clip }) =>
    clip === null ? [] : [{ clip_sha256: clip.clip_sha256, file: clip.file, levels: slot.levels, exemplar: slot.exemplar }],
  );
}

/** `clip` put into a place, or taken out of its cell (null); a clip that is there goes to where this one comes from. */
export function withMoved(places: readonly Place[], data: Data, clip: Place, to: Slot | null): Place[] {
  const { filled } = arrangementOf(places, data);
  const from = filled.find((one) => one.clip === clip)?.slot;
  const there = to === null ? null : filled.find(({ slot }) => slot.name === to.name)?.clip;
  const put = (member: Place, slot: Slot | null | undefined): Place => ({
    ...member,
    levels: slot?.levels ?? member.levels,
    exemplar: slot?.exemplar ?? 0,
  });
  return places.map((member) => (member === clip ? put(member, to) : member === there ? put(member, from) : member));
}

/** `places` with what the study and an upload have now: clips that are gone left out, others added to those in no cell. */
export function reconciled(places: readonly Place[], known: readonly Place[]): Place[] {
  const present = places.filter((member) => known.some((one) => isClip(one, member)));
  return [...present, ...known.filter((one) => !places.some((member) => isClip(one, member)))];
}

/** Whether no two factors, and no two levels of one, have one name; while one is typed it may be that of another. */
export function hasOwnNames(data: Data): boolean {
  const factors = factorsOf(data);
  return [factors.map(({ name }) => name), ...factors.map(({ levels }) => levels)].every((names) => new Set(names).size === names.length);
}

/**
 * `places` after an edit of the declaration: a factor or level that got another name keeps its clips. Names are taken by
 * their positions where two were alike in between, as then nothing was put into another order.
 */
export function withRenames(places: readonly Place[], before: Data, after: Data, byPosition = false): readonly Place[] {
  if (!hasOwnNames(after)) return places;
  const [old, fresh] = [factorsOf(before), factorsOf(after)];
  const factors = renames(
    old.map(({ name }) => name),
    fresh.map(({ name }) => name),
    byPosition,
  );
  const levels = new Map<string, Map<string, string>>();
  for (const [position, { name, levels: names }] of old.entries()) {
    const next = old.length === fresh.length ? fresh[position] : fresh.find((one) => one.name === name);
    if (next !== undefined) levels.set(name, renames(names, next.levels, byPosition));
  }
  const renamed = places.map((member) => {
    const own = Object.entries(member.levels);
    const next = own.map(([factor, level]) => [factors.get(factor) ?? factor, levels.get(factor)?.get(level) ?? level] as const);
    const isSame = next.every(([factor, level], index) => own[index]?.[0] === factor && own[index][1] === level);
    return isSame ? member : { ...member, levels: Object.fromEntries(next) };
  });
  return renamed.some((member, index) => member !== places[index]) ? renamed : places;
}

/** Whether each clip is where it is stored. */
export function isAsStored(places: readonly Place[], stored: readonly Place[], data: Data): boolean {
  const factors = factorsOf(data);
  const all = (of: readonly Place[]) =>
    of
      .filter(({ exemplar }) => exemplar > 0)
      .map((member) => `${addressOf(member.levels, member.exemplar, factors)} ${member.clip_sha256} ${member.file}`)
      .sort()
      .join("\n");
  return all(places) === all(stored);
}

// Clips that two people moved.

export interface ClipMeeting {
  /** Files that both moved, each to another place, or that are after one place: for now where they put them. */
  both: readonly string[];
  /** Files that only they moved: kept. */
  theirs: readonly string[];
  /** Every clip, those of `both` where they put them. */
  places: readonly Place[];
  /** Every clip, those of `both` where I put them. */
  mine: readonly Place[];
}

/** The declarations of the version that the work began from, of the work, and of what somebody else saved. */
interface Declarations {
  base: Data;
  mine: Data;
  theirs: Data;
}

/**
 * My places brought together with what is stored now. Clips and places are taken by groups: a swap is a group, and so are
 * two swaps that share a clip or a place. A group that only one of us moved is as they left it, so no clip loses its place.
 */
export function meetingOfClips(
  mine: readonly Place[],
  stored: readonly Place[],
  { base, mine: my, theirs: their }: Declarations,
): ClipMeeting {
  const factors = factorsOf(my);
  const fromTheirs = withRenames(stored, base, my);
  const fromMine = withRenames(mine, base, their);
  const origins = mine.map((member): Place => ({ ...member, ...(member.from ?? { exemplar: 0 }) }));
  const before = withRenames(withRenames(origins, base, their), base, my);
  const addressIn = (one: Place | undefined) =>
    one === undefined || one.exemplar === 0 ? "" : addressOf(one.levels, one.exemplar, factors);
  const clips = [...fromMine, ...fromTheirs.filter((one) => !fromMine.some((member) => isClip(member, one)))].map((clip) => {
    const other = fromTheirs.find((one) => isClip(one, clip));
    const own = fromMine.find((one) => isClip(one, clip)) ?? clip;
    const at = [before.find((one) => isClip(one, clip)), own, other].map(addressIn) as [string, string, string];
    return { clip, own, other, at, isMine: fromMine.includes(clip) && at[1] !== at[0], isTheirs: at[2] !== at[0] };
  });
  const both = new Set<string>();
  const groups = groupsOf(clips, ({ at }) => at.filter((address) => address !== ""));
  const met = new Set(
    groups.filter((group) => {
      const merged = group.map(({ at, isMine }) => (isMine ? at[1] : at[2])).filter((address) => address !== "");
      const isMet = (one: (typeof clips)[number]) => one.isMine && one.isTheirs && one.at[1] !== one.at[2];
      const isCrowded = new Set(merged).size < merged.length;
      if (!isCrowded && !group.some(isMet)) return false;
      for (const one of group) if (isMet(one) || (isCrowded && (one.isMine || one.isTheirs))) both.add(one.clip.file);
      return true;
    }),
  );
  const arranged = (isMineFirst: boolean) =>
    groups.flatMap((group) =>
      group.flatMap(({ clip, own, other, isMine }): Place[] => {
        // A clip that they took out of the study is not there to be put anywhere.
        if (other === undefined) return clip.upload === null ? [] : [met.has(group) && !isMineFirst ? { ...own, exemplar: 0 } : own];
        const taken = (met.has(group) ? isMineFirst && fromMine.includes(clip) : isMine) ? own : other;
        return [{ ...other, levels: taken.levels, exemplar: taken.exemplar }];
      }),
    );
  const theirs = clips.filter(({ clip, isMine, isTheirs }) => isTheirs && !isMine && !both.has(clip.file) && clip.upload === null);
  return { both: [...both], theirs: theirs.map(({ clip }) => clip.file), places: arranged(false), mine: arranged(true) };
}

/** Members that share a key, directly or by others, together. */
function groupsOf<T>(members: readonly T[], keys: (member: T) => readonly string[]): T[][] {
  const groups: { keys: Set<string>; members: T[] }[] = [];
  for (const member of members) {
    const own = keys(member);
    const touching = groups.filter((group) => own.some((key) => group.keys.has(key)));
    const joined = {
      keys: new Set([...own, ...touching.flatMap((group) => [...group.keys])]),
      members: [...touching.flatMap((group) => group.members), member],
    };
    groups.splice(0, groups.length, ...groups.filter((group) => !touching.includes(group)), joined);
  }
  return groups.map((group) => group.members);
}

/** Old names with the new ones at the same positions, where nothing came or went and no name moved. */
function renames(before: readonly string[], after: readonly string[], byPosition: boolean): Map<string, string> {
  if (before.length !== after.length) return new Map();
  const pairs = before.flatMap((name, index): [string, string][] => (after[index] === name ? [] : [[name, after[index] ?? ""]]));
  const isOther = byPosition || pairs.every(([name, next]) => !after.includes(name) && !before.includes(next));
  return new Map(isOther ? pairs : []);
}

/** The numbers that files of one cell have, where each has another from 1 on; else they are counted in the order of their marks. */
function numbersOf(marks: readonly string[]): number[] {
  const numbers = marks.map((mark) => (/^\d+$/.test(mark) ? Number(mark) : 0));
  if (numbers.every((number) => number >= 1 && number <= MAX_PER_CELL) && new Set(numbers).size === numbers.length) return numbers;
  const order = [...marks.keys()].sort((a, b) => (numbers[a] ?? 0) - (numbers[b] ?? 0) || a - b);
  return [...marks.keys()].map((index) => order.indexOf(index) + 1);
}

/** Factors, levels, clips per cell and every place, as a pattern reads them from the names of files. */
export function filledByPattern(places: readonly Place[], data: Data, pattern: string): { data: Data; places: Place[] } {
  const fields = fieldsOf(pattern);
  const read = new Map(
    levelsByPattern(
      pattern,
      places.map(({ file }) => file),
    ).map(({ file, levels }) => [file, levels]),
  );
  const named = fields.filter((field) => field !== "exemplar");
  const cells = new Map<string, { member: Place; own: Record<string, string> }[]>();
  const strays: Place[] = [];
  for (const member of [...places].sort((a, b) => a.file.localeCompare(b.file, "en", { numeric: true }))) {
    const matches = read.get(member.file) ?? null;
    if (matches === null) {
      strays.push(member);
      continue;
    }
    const own = Object.fromEntries(fields.map((field, index) => [field, matches[index] ?? ""]));
    const cell = JSON.stringify(named.map((field) => own[field]));
    cells.set(cell, [...(cells.get(cell) ?? []), { member, own }]);
  }
  const fitting = [...cells.values()].flatMap((members) => {
    const numbers = numbersOf(members.map(({ own }) => own["exemplar"] ?? ""));
    return members.map(({ member, own }, index): Place => {
      const levels = Object.fromEntries(named.map((field) => [field, own[field] ?? ""]));
      return { ...member, levels: { ...member.levels, ...levels }, exemplar: numbers[index] ?? 1 };
    });
  });
  // The first of two clips for one place takes it: one that fits comes before one that was there.
  const next = [...fitting, ...strays];
  const known = listAt(data, ["factors"]);
  const knownNames = known.map((factor) => textAt(factor, ["name"]));
  const fill = (name: string) => {
    const declared = known[knownNames.indexOf(name)];
    const levels = listAt(declared, ["levels"]);
    const names = new Set(levels.map((level) => textAt(level, ["name"])));
    const fresh = [...new Set(next.map((member) => levelOf(member.levels, name)))].filter((level) => level !== "" && !names.has(level));
    return {
      ...(isTable(declared) ? declared : { name, label: `${name.charAt(0).toUpperCase()}${name.slice(1).replaceAll("_", " ")}` }),
      levels: [...levels, ...fresh.map((level) => ({ name: level, label: level }))],
    };
  };
  const factors = [
    ...known.map((factor, index) => (named.includes(knownNames[index] ?? "") ? fill(knownNames[index] ?? "") : factor)),
    ...named.filter((name) => !knownNames.includes(name)).map(fill),
  ];
  const perCell = fitting.reduce((most, { exemplar }) => Math.max(most, exemplar), 1);
  const withFactors = withValue(data, ["factors"], factors);
  return { data: withValue(withFactors, ["exemplars", "per_cell"], perCell) as Data, places: next };
}

// The grid of a new study: its factors as they are typed, its clips, and the table that the server reads.

/** A factor as it is typed: its name, and its levels separated by commas. */
export interface TypedFactor {
  name: string;
  levels: string;
}

export interface NewCells {
  factors: readonly TypedFactor[];
  places: readonly Place[];
}

const levelsOfText = (text: string) => [
  ...new Set(
    text
      .split(/[,;\n]/)
      .map((level) => level.trim())
      .filter((level) => level !== ""),
  ),
];

/** The design of typed factors; each cell has as many places as the clips fill. */
export function designOfTyped({ factors, places }: NewCells): Data {
  const known = factors
    .map(({ name, levels }) => ({ name: factorName(name), levels: levelsOfText(levels) }))
    .filter(({ name, levels }) => name !== "" && levels.length > 0);
  const cells = known.reduce((product, { levels }) => product * levels.length, 1);
  return {
    factors: known.map(({ name, levels }) => ({ name, levels: levels.map((level) => ({ name: level, label: level })) })),
    exemplars: { per_cell: Math.max(1, Math.ceil(places.length / cells)) },
  };
}

/** What a grid begins with: the factors that a pattern reads from the names of files, or one that is still to be named. */
export function cellsByPattern(places: readonly Place[], pattern: string): NewCells {
  const read = filledByPattern(places, {}, pattern);
  const factors = factorsOf(read.data).map(({ name, levels }) => ({ name, levels: levels.join(", ") }));
  return { factors: factors.length > 0 ? factors : [{ name: "", levels: "" }], places: read.places };
}

/** Every clip in a place, both in their order: files by name, cells by rows. */
export function filledInOrder(cells: NewCells): Place[] {
  const slots = slotsOf(designOfTyped(cells));
  const sorted = [...cells.places].sort((a, b) => a.file.localeCompare(b.file, "en", { numeric: true }));
  return sorted.map((member, index) => ({ ...member, levels: slots[index]?.levels ?? {}, exemplar: slots[index]?.exemplar ?? 0 }));
}

/** What a grid lacks before a study can be made of it; false where nothing. */
export function gridProblem(cells: NewCells): string | false {
  const data = designOfTyped(cells);
  const names = factorsOf(data).map(({ name }) => name);
  if (names.length === 0) return "what varies between the clips with its levels";
  for (const { name, levels } of cells.factors) {
    const known = levelsOfText(levels);
    if (factorName(name) === "" && known.length > 0) return `a name for ${known.join(", ")}`;
    if (factorName(name) !== "" && known.length === 0) return `levels of ${name}`;
    const slashed = known.find((level) => level.includes("/"));
    if (slashed !== undefined) return `a level without a slash in the place of ${slashed}`;
  }
  if (new Set(names).size < names.length) return "another name for each factor";
  const { filled, rest } = arrangementOf(cells.places, data);
  const empty = filled.filter(({ clip }) => clip === null).length;
  if (rest.length > 0 && empty > 0) return "a cell for each clip";
  if (empty > 0) return "a clip for each place of the grid, or other levels";
  return reservedProblem(names, TABLE_COLUMNS);
}

/** The levels of each factor that has a name. */
export const levelsOfCells = (cells: NewCells) => factorsOf(designOfTyped(cells)).map(({ levels }) => levels);

/** Columns that the table has next to the factors. */
const TABLE_COLUMNS = ["file", "exemplar"];
const quoted = (text: string) => `"${text.replaceAll('"', '""')}"`;

/** The table of levels: one row for each clip in a cell. */
export function tableOfCells(cells: NewCells): string {
  const data = designOfTyped(cells);
  const names = factorsOf(data).map(({ name }) => name);
  const rows = arrangementOf(cells.places, data).filled.flatMap(({ slot, clip }) =>
    clip === null ? [] : [[clip.file, ...names.map((name) => slot.levels[name] ?? ""), String(slot.exemplar)]],
  );
  return [["file", ...names, "exemplar"], ...rows].map((row) => row.map(quoted).join(",")).join("\n");
}

/** A table of levels to be filled in: each file with an empty cell. */
export function tableToFill(files: readonly string[]): string {
  return ["file,factor", ...files.map((file) => `${/[",]/.test(file) ? quoted(file) : file},`)].join("\n");
}
