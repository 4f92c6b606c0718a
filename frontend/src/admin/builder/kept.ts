/** Unsaved work of the builder, kept in this browser: over a closed tab, a lost sign-in, a crash. */

import { type Data, isTable } from "./data";

export interface Kept {
  toml: string;
  /** What the text shall say, where the server had not written it yet. */
  data: Data | null;
  /** Revision of the study that the work began from. */
  revision: number;
  at: string;
}

const key = (study: string) => `palpebra-builder:${study}`;

export function keptWork(study: string): Kept | null {
  try {
    const stored: unknown = JSON.parse(localStorage.getItem(key(study)) ?? "null");
    if (typeof stored !== "object" || stored === null) return null;
    const { toml, data, revision, at } = stored as Partial<Kept>;
    if (typeof toml !== "string" || typeof revision !== "number" || typeof at !== "string") return null;
    return { toml, data: isTable(data) ? data : null, revision, at };
  } catch {
    return null;
  }
}

export function keepWork(study: string, work: Omit<Kept, "at">): void {
  try {
    localStorage.setItem(key(study), JSON.stringify({ ...work, at: new Date().toISOString() }));
  } catch {
    // A full or forbidden store: the work stays on the page.
  }
}

export function forgetWork(study: string): void {
  try {
    localStorage.removeItem(key(study));
  } catch {
    // Nothing was kept.
  }
}
