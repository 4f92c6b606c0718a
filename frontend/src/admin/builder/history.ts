/** States of a declaration under edit, with undo and redo; edits of two people that meet. */
import { type Data, isTable, type Path, pathName, placeTitle, textAt, withDerivedName, withValue } from "./data";
import { type ClipMeeting, hasOwnNames, type Place, withRenames } from "./places";

/** Clips in cells, null as stored; and those that are stored. */
type Places = readonly Place[] | null;

interface State {
  data: Data;
  /** Clips in other cells than stored; null where none was moved. */
  places: Places;
  /** The declaration whose names the clips have: an earlier one while two levels have one name. */
  named: Data;
  /** The same as TOML; null until the server has written it. */
  toml: string | null;
  /** What was edited and when, so that typing one word is one step. */
  edited: string;
  at: number;
}

export interface History {
  past: readonly State[];
  now: State;
  future: readonly State[];
}

const ONE_STEP_MS = 1_500;
const MAX_STEPS = 200;

export function begun(data: Data, toml: string, places: Places = null): History {
  return { past: [], now: { data, toml, places, named: data, edited: "", at: 0 }, future: [] };
}

/** Clips after an edit of the declaration: they follow their levels to another name. */
function following({ now }: History, data: Data, stored: Places): Pick<State, "places" | "named"> {
  const places = now.places ?? stored ?? [];
  const next = withRenames(places, now.named, data, now.named !== now.data);
  return { places: next === places ? now.places : next, named: hasOwnNames(data) ? data : now.named };
}

/** One key set to another value (undefined removes it); edits of one key in a row are one step. `saved` is what is stored. */
export function edited(history: History, path: Path, value: unknown, at: number, saved: unknown = null, stored: Places = null): History {
  const data = withDerivedName(history.now.data, saved, path, value);
  return stepped(history, { data, toml: null, ...following(history, data, stored), edited: pathName(path), at });
}

/** The whole text replaced; `data` is its content. */
export function rewritten(history: History, toml: string, data: Data, at: number, stored: Places = null): History {
  return stepped(history, { data, toml, ...following(history, data, stored), edited: "toml", at });
}

/** Clips put into other cells, and with them perhaps other factors: one step. */
export function rearranged(history: History, places: Places, data: Data, at: number): History {
  const toml = data === history.now.data ? history.now.toml : null;
  const named = hasOwnNames(data) ? data : history.now.named;
  return stepped(history, { data, toml, places, named, edited: `clips ${String(at)}`, at });
}

function stepped(history: History, next: State): History {
  const goesOn = history.now.edited === next.edited && next.at - history.now.at < ONE_STEP_MS;
  const past = goesOn ? history.past : [...history.past, history.now].slice(-MAX_STEPS);
  return { past, now: next, future: [] };
}

/** The server has written the present state as TOML. */
export function written(history: History, data: Data, toml: string): History {
  return history.now.data === data ? { ...history, now: { ...history.now, toml } } : history;
}

export function undone(history: History): History {
  const before = history.past.at(-1);
  if (before === undefined) return history;
  return { past: history.past.slice(0, -1), now: { ...before, at: 0 }, future: [history.now, ...history.future] };
}

export function redone(history: History): History {
  const [next, ...future] = history.future;
  if (next === undefined) return history;
  return { past: [...history.past, history.now], now: { ...next, at: 0 }, future };
}

/** The newest text that is known: further data are written into it. */
export function latestToml(history: History): string {
  return [history.now, ...[...history.past].reverse()].find((state) => state.toml !== null)?.toml ?? "";
}

// Edits of two people, or of two tabs, that began from the same version.

/** A key of a table, or an element of a list by name: a place that stays the same when elements come and go. */
type Step = string | { named: string };

export interface Change {
  at: readonly Step[];
  before: unknown;
  after: unknown;
}

export interface MeetingEdit {
  /** As the server names places, with the names of elements. */
  path: string;
  mine: Change;
  theirs: Change;
}

export interface Meeting {
  /** Their version with every change of mine in it. */
  merged: Data;
  /** What they changed and I did not: kept. */
  theirs: readonly Change[];
  /** What I changed and they did not: in it again. */
  mine: readonly Change[];
  /** What both changed, each in another way: mine for now. */
  both: readonly MeetingEdit[];
  /** Comments of mine in the TOML that the merged text lacks, as both changed comments. */
  lostComments?: readonly string[];
  /** Clips that both moved, or one of us; not there where I moved none. */
  clips?: ClipMeeting;
}

/** Edits that began from `base`, brought together. */
export function meetingOf(base: unknown, mine: Data, theirs: Data): Meeting {
  const [my, other] = [changesBetween(base, mine), changesBetween(base, theirs)];
  const places = new Map<string, readonly Step[]>();
  const met = new Set<Change>();
  for (const change of my) {
    const overlapping = other.filter((one) => isWithin(one.at, change.at) || isWithin(change.at, one.at));
    const around = overlapping.find((one) => isWithin(change.at, one.at));
    // Where they took out what my change is in, it is all of that which both changed.
    const isGone = around !== undefined && contentAt(theirs, change.at.slice(0, -1)) === undefined;
    const at = isGone ? around.at : change.at;
    if (overlapping.length === 0 || isSame(contentAt(mine, at), contentAt(theirs, at))) continue;
    places.set(placeName(at), at);
    for (const one of [change, ...overlapping]) met.add(one);
  }
  const changeTo = (data: Data, at: readonly Step[]) => ({ at, before: contentAt(base, at), after: contentAt(data, at) });
  const both = [...places].map(([path, at]) => ({ path, mine: changeTo(mine, at), theirs: changeTo(theirs, at) }));
  const alone = my.filter((change) => !met.has(change));
  const kept = [...alone, ...both.map((edit) => edit.mine)];
  return {
    merged: kept.reduce((data, change) => withChange(data, change.at, change.after), theirs),
    theirs: other.filter((change) => !met.has(change)),
    mine: alone,
    both,
  };
}

/** What is at a place; undefined where there is none. */
function contentAt(data: unknown, at: readonly Step[]): unknown {
  let here = data;
  for (const step of at) here = typeof step !== "string" ? elementOf(here, step.named) : isTable(here) ? here[step] : undefined;
  return here;
}

/** "forms.about.fields.age.minimum" */
export function placeName(at: readonly Step[]): string {
  return at.map((step) => (typeof step === "string" ? step : step.named)).join(".");
}

/** "“Minimum” of the question age of the questionnaire about" */
export function placeInWords(at: readonly Step[]): string {
  return placeTitle(at.map((step) => (typeof step === "string" ? step : step.named)));
}

function isWithin(inner: readonly Step[], outer: readonly Step[]): boolean {
  return `${placeName(inner)}.`.startsWith(`${placeName(outer)}.`);
}

/** The differences, as few and as small as keys and names of elements allow. */
export function changesBetween(before: unknown, after: unknown, at: readonly Step[] = []): Change[] {
  if (isSame(before, after)) return [];
  if (isTable(before) && isTable(after)) {
    const keys = new Set([...Object.keys(before), ...Object.keys(after)]);
    return [...keys].flatMap((key) => changesBetween(before[key], after[key], [...at, key]));
  }
  const [old, fresh] = [namesOf(before), namesOf(after)];
  const inBoth = (names: readonly string[]) => names.filter((name) => old?.includes(name) && fresh?.includes(name));
  if (old === null || fresh === null || !isSame(inBoth(old), inBoth(fresh))) return [{ at, before, after }];
  return [...new Set([...old, ...fresh])].flatMap((named) =>
    changesBetween(elementOf(before, named), elementOf(after, named), [...at, { named }]),
  );
}

/** The names of a list's elements; null for other values, and for lists whose elements lack unique names. */
function namesOf(list: unknown): string[] | null {
  if (!Array.isArray(list)) return null;
  const names = (list as unknown[]).map(nameOf);
  return names.includes("") || new Set(names).size < names.length ? null : names;
}

const nameOf = (element: unknown) => textAt(element, ["name"]) || textAt(element, ["value"]);
const elementOf = (list: unknown, named: string) =>
  Array.isArray(list) ? (list as unknown[]).find((one) => nameOf(one) === named) : undefined;

export function isSame(one: unknown, other: unknown): boolean {
  if (one === other) return true;
  if (Array.isArray(one) && Array.isArray(other))
    return one.length === other.length && (one as unknown[]).every((value, index) => isSame(value, (other as unknown[])[index]));
  if (!isTable(one) || !isTable(other)) return false;
  const keys = new Set([...Object.keys(one), ...Object.keys(other)]);
  return [...keys].every((key) => isSame(one[key], other[key]));
}

/** `data` with another value at a place; undefined takes it out. An element that is not there is put at the end. */
export function withChange(data: Data, at: readonly Step[], value: unknown): Data {
  const path: (string | number)[] = [];
  let here: unknown = data;
  for (const step of at) {
    const list = Array.isArray(here) ? (here as unknown[]) : [];
    const position = typeof step === "string" ? -1 : list.findIndex((one) => nameOf(one) === step.named);
    const part = typeof step === "string" ? step : position < 0 ? list.length : position;
    // Nothing is there to be taken out of.
    if (here === undefined && value === undefined) return data;
    path.push(part);
    here = typeof part === "number" ? list[part] : isTable(here) ? here[part] : undefined;
  }
  if (value === undefined && here === undefined) return data;
  return withValue(data, path, value) as Data;
}
