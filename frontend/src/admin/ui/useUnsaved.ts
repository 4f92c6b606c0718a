/** Asks before unsaved work is left: by a link of the site, or by closing the tab. */

import { useBlocker } from "@tanstack/react-router";

/** Whether work may be replaced by other: saved, or given up by who is asked. */
export function mayReplace(unsaved: boolean): boolean {
  return !unsaved || window.confirm("There is work that is not saved. Open another file in its place all the same?");
}

export function useUnsaved(unsaved: boolean): void {
  useBlocker({
    shouldBlockFn: () => unsaved && !window.confirm("There is work that is not saved. Leave all the same?"),
    enableBeforeUnload: () => unsaved,
  });
}
