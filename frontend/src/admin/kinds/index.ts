/** The kinds of trial as the admin site knows them: one folder each here, found by name. */

import { isTable, textAt } from "../builder/data";
import type { AdminKind, ShownClips } from "./kind";

const folders = import.meta.glob<AdminKind>("./*/facts.ts", { import: "kind", eager: true });

/** The kind of a declaration that names none. */
export const DEFAULT_KIND = "clip_rating";

/** What is known of a kind; nothing of one without a folder, which is shown like single clips. */
export function adminKind(name: string): AdminKind {
  return folders[`./${name}/facts.ts`] ?? {};
}

/** The clips that one trial shows, in words, and whether they are listed one below the other. */
export function shownClips(trial: unknown): ShownClips {
  if (!isTable(trial)) return { words: ["clip"], stacked: false };
  const single = { words: isTable(trial["reference"]) ? ["reference", "clip"] : ["clip"], stacked: false };
  return adminKind(textAt(trial, ["kind"])).preview?.(trial) ?? single;
}
