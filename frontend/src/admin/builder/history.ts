/** States of a declaration under edit, with undo and redo. */
import { type Data, type Path, pathName, withDerivedName } from "./data";

interface State {
  data: Data;
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

export function begun(data: Data, toml: string): History {
  return { past: [], now: { data, toml, edited: "", at: 0 }, future: [] };
}

/** One key set to another value (undefined removes it); edits of one key in a row are one step. `saved` is what is stored. */
export function edited(history: History, path: Path, value: unknown, at: number, saved: unknown = null): History {
  const data = withDerivedName(history.now.data, saved, path, value);
  return stepped(history, { data, toml: null, edited: pathName(path), at });
}

/** The whole text written anew; `data` is what it says. */
export function rewritten(history: History, toml: string, data: Data, at: number): History {
  return stepped(history, { data, toml, edited: "toml", at });
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
