/** Which clip is in which cell of a study of own clips: moved, swapped, filled from file names, kept when levels are renamed. */

import type { Schemas } from "../api";
import { fieldsOf, levelsByPattern } from "../studies/file-pattern";
import { type Data, isTable, listAt, tableAt, textAt, withValue } from "./data";

/** A clip with its cell; the exemplar is 0 while it is in none. */
export interface Place {
  clip_sha256: string;
  file: string;
  levels: Record<string, string>;
  exemplar: number;
  /** The upload that it comes from; null for a clip of the study. */
  upload: string | null;
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
const addressOf = (levels: Readonly<Record<string, string>>, exemplar: number, factors: readonly Factor[]) =>
  JSON.stringify([...factors.map(({ name }) => levels[name] ?? ""), exemplar]);

export function storedPlaces(clips: readonly Schemas["ClipOut"][]): Place[] {
  return clips.map(({ clip_sha256, file, levels, exemplar }) => ({ clip_sha256, file, levels, exemplar, upload: null }));
}

export function factorsOf(data: Data): Factor[] {
  return listAt(data, ["factors"]).map((factor) => ({
    name: textAt(factor, ["name"]),
    levels: listAt(factor, ["levels"]).map((level) => textAt(level, ["name"])),
  }));
}

const MAX_SLOTS = 5_000;

/** Every place of the design, in the order of its cells: the last factor changes fastest. */
export function slotsOf(data: Data): Slot[] {
  const factors = factorsOf(data);
  if (factors.length === 0) return [];
  const perCell = Math.min(Math.max(1, Number(tableAt(data, ["exemplars"])["per_cell"] ?? 1) || 1), 100);
  let cells: Record<string, string>[] = [{}];
  for (const { name, levels } of factors)
    cells = cells.flatMap((cell) => levels.map((level) => ({ ...cell, [name]: level }))).slice(0, MAX_SLOTS);
  return cells.flatMap((levels) =>
    Array.from({ length: perCell }, (_, index) => ({
      levels,
      exemplar: index + 1,
      name: `${factors.map(({ name }) => levels[name] ?? "").join("/")}, no. ${String(index + 1)}`,
    })),
  );
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

/** `places` after an edit of the declaration: a factor or level that got another name keeps its clips. */
export function withRenames(places: readonly Place[], before: Data, after: Data): readonly Place[] {
  const [old, fresh] = [factorsOf(before), factorsOf(after)];
  const factors = renames(
    old.map(({ name }) => name),
    fresh.map(({ name }) => name),
  );
  const levels = new Map<string, Map<string, string>>();
  for (const [position, { name, levels: names }] of old.entries()) {
    const next = old.length === fresh.length ? fresh[position] : fresh.find((one) => one.name === name);
    if (next !== undefined) levels.set(name, renames(names, next.levels));
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

/** Old names with the new ones at the same positions, where nothing came or went and no name moved. */
function renames(before: readonly string[], after: readonly string[]): Map<string, string> {
  if (before.length !== after.length) return new Map();
  const pairs = before.flatMap((name, index): [string, string][] => (after[index] === name ? [] : [[name, after[index] ?? ""]]));
  const isOther = pairs.every(([name, next]) => !after.includes(name) && !before.includes(next));
  return new Map(isOther ? pairs : []);
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
  const taken = new Map<string, number>();
  const next = [...places]
    .sort((a, b) => a.file.localeCompare(b.file, "en", { numeric: true }))
    .map((member): Place => {
      const matches = read.get(member.file) ?? null;
      if (matches === null) return member;
      const own = Object.fromEntries(fields.map((field, index) => [field, matches[index] ?? ""]));
      const levels = Object.fromEntries(named.map((field) => [field, own[field] ?? ""]));
      const cell = JSON.stringify(named.map((field) => levels[field]));
      taken.set(cell, (taken.get(cell) ?? 0) + 1);
      return { ...member, levels: { ...member.levels, ...levels }, exemplar: taken.get(cell) ?? 1 };
    });
  const known = listAt(data, ["factors"]);
  const factors = named.map((name) => {
    const declared = known.find((factor) => textAt(factor, ["name"]) === name);
    const levels = listAt(declared, ["levels"]);
    const names = new Set(levels.map((level) => textAt(level, ["name"])));
    const fresh = [...new Set(next.flatMap((member) => member.levels[name] ?? []))].filter((level) => !names.has(level));
    return {
      ...(isTable(declared) ? declared : { name, label: `${name.charAt(0).toUpperCase()}${name.slice(1).replaceAll("_", " ")}` }),
      levels: [...levels, ...fresh.map((level) => ({ name: level, label: level }))],
    };
  });
  const others = known.filter((factor) => !named.includes(textAt(factor, ["name"])));
  const perCell = Math.max(1, ...taken.values());
  const withFactors = withValue(data, ["factors"], [...others, ...factors]);
  return { data: withValue(withFactors, ["exemplars", "per_cell"], perCell) as Data, places: next };
}
