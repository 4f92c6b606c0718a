/** Asks before unsaved work is left: by a link of the site, or by closing the tab. */

import { useBlocker } from "@tanstack/react-router";

export function useUnsaved(unsaved: boolean): void {
  useBlocker({
    shouldBlockFn: () => unsaved && !window.confirm("There is work that is not saved. Leave all the same?"),
    enableBeforeUnload: () => unsaved,
  });
}
