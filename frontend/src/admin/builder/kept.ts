/**
 * Unsaved work of the builder, kept in this browser: over a reload, a lost sign-in, a crash, a closed tab.
 * Each tab has its own draft, so that saving in one never touches what another has not saved. What a tab left
 * behind can be opened from any other.
 */

import { type Data, isTable } from "./data";
import type { Place } from "./places";

export interface Kept {
  toml: string;
  /** What the text shall say, where the server had not written it yet. */
  data: Data | null;
  /** Revision of the study that the work began from. */
  revision: number;
  /** The stored text that the work began from; null in work that was kept before this was. */
  base: string | null;
  /** Clips in other cells than stored; null where none was moved. */
  places: readonly Place[] | null;
  at: string;
}

/** Whether kept work differs from the stored text. */
export const isUnsaved = ({ toml, data, places }: Kept, stored: string): boolean => data !== null || places !== null || toml !== stored;

export interface Draft extends Kept {
  /** Where it is kept. */
  key: string;
}

const TAB = "palpebra-builder-tab";
const prefix = (study: string) => `palpebra-builder:${study}`;
const key = (study: string) => `${prefix(study)}:${tab}`;

/** This tab's name, here and on the server. */
export const tab = thisTab();

/**
 * A name for this tab that survives a reload. It is in the tab's store only while no page has it: a duplicated tab copies
 * that store, and would otherwise write over the draft of the first.
 */
function thisTab(): string {
  const name = taken() ?? crypto.randomUUID();
  window.addEventListener("pagehide", () => {
    try {
      sessionStorage.setItem(TAB, name);
    } catch {
      // The next page of this tab begins with a new name, and offers this draft.
    }
  });
  window.addEventListener("pageshow", () => taken());
  return name;
}

function taken(): string | null {
  try {
    const name = sessionStorage.getItem(TAB);
    sessionStorage.removeItem(TAB);
    return name;
  } catch {
    return null;
  }
}

/** Stored work as it was kept; null where it is anything else. */
export function keptFrom(stored: unknown): Kept | null {
  if (typeof stored !== "object" || stored === null) return null;
  const { toml, data, revision, base, at, places } = stored as Partial<Kept>;
  if (typeof toml !== "string" || typeof revision !== "number" || typeof at !== "string") return null;
  const texts = { toml, base: typeof base === "string" ? base : null, at };
  return { ...texts, data: isTable(data) ? data : null, revision, places: Array.isArray(places) ? places : null };
}

function read(where: string): Kept | null {
  try {
    return keptFrom(JSON.parse(localStorage.getItem(where) ?? "null"));
  } catch {
    return null;
  }
}

/** This tab's own draft. */
export function keptWork(study: string): Kept | null {
  return read(key(study));
}

/** Drafts of this study that other tabs have or left behind, the latest first. */
export function otherWork(study: string): Draft[] {
  let keys: string[];
  try {
    keys = Object.keys(localStorage);
  } catch {
    return [];
  }
  return keys
    .filter((one) => (one === prefix(study) || one.startsWith(`${prefix(study)}:`)) && one !== key(study))
    .flatMap((one) => {
      const kept = read(one);
      return kept === null ? [] : [{ ...kept, key: one }];
    })
    .sort((a, b) => b.at.localeCompare(a.at));
}

export function keepWork(study: string, work: Omit<Kept, "at">): void {
  try {
    localStorage.setItem(key(study), JSON.stringify({ ...work, at: new Date().toISOString() }));
  } catch {
    // A full or forbidden store: the work stays on the page.
  }
}

/** The name on the server of the tab that left a draft in this browser. */
export const tabOf = (draft: Draft) => draft.key.split(":").at(-1) ?? "";

/** Forget this tab's draft, and none of another tab. */
export function forgetWork(study: string): void {
  forgetDraft(key(study));
}

/** Forget one draft that somebody chose to discard. */
export function forgetDraft(where: string): void {
  try {
    localStorage.removeItem(where);
  } catch {
    // Nothing was kept.
  }
}
