/** States that can be undone and done again; a drag is one step. */

const LONGEST = 500;

export interface History<T> {
  readonly now: T;
  readonly past: readonly T[];
  readonly future: readonly T[];
  /** Changes with the same name, one after the other, are one step; null begins a new one. */
  readonly step: string | null;
}

export function begun<T>(now: T): History<T> {
  return { now, past: [], future: [], step: null };
}

/** A change; one that carries the name of the step before joins it. */
export function changed<T>(history: History<T>, now: T, step: string | null = null): History<T> {
  if (now === history.now) return history;
  if (step !== null && step === history.step) return { ...history, now, future: [] };
  return { now, past: [...history.past, history.now].slice(-LONGEST), future: [], step };
}

export function undone<T>(history: History<T>): History<T> {
  const now = history.past.at(-1);
  if (now === undefined) return history;
  return { now, past: history.past.slice(0, -1), future: [history.now, ...history.future], step: null };
}

export function redone<T>(history: History<T>): History<T> {
  const now = history.future[0];
  if (now === undefined) return history;
  return { now, past: [...history.past, history.now], future: history.future.slice(1), step: null };
}
