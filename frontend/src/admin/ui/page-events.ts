/** Keys of a page, and the question before unsaved work is left. */

import { useEffect, useEffectEvent } from "react";
import { useBlocker } from "@tanstack/react-router";

// Keys of a page. They rest while a person types into a field, Space and Enter on a button too.

export type Shortcuts = Readonly<Record<string, (event: KeyboardEvent) => void>>;

/** Name of a pressed key: "n", "arrowleft", "ctrl+z", "ctrl+shift+z"; for Shift alone, look at the event. */
function nameOf(event: KeyboardEvent): string {
  const key = event.key.toLowerCase();
  if (!event.ctrlKey && !event.metaKey) return key;
  return `ctrl+${event.shiftKey && !key.startsWith("arrow") ? "shift+" : ""}${key}`;
}

const TYPED_INTO = "input, textarea, select, [contenteditable], [role=dialog]";
const PRESSED = "button, a, [role=button], summary";

/** True where a key belongs to what has the focus: a field's own text, and Space and Enter on what they press. */
export function isOwnKey(key: string, target: EventTarget | null): boolean {
  const presses = key === " " || key === "Enter";
  return target instanceof Element && target.closest(presses ? `${TYPED_INTO}, ${PRESSED}` : TYPED_INTO) !== null;
}

export function useShortcuts(shortcuts: Shortcuts): void {
  const pressed = useEffectEvent((event: KeyboardEvent): void => {
    const action = shortcuts[nameOf(event)];
    if (action === undefined || event.defaultPrevented || event.altKey || isOwnKey(event.key, event.target)) return;
    event.preventDefault();
    action(event);
  });
  useEffect(() => {
    const press = (event: KeyboardEvent): void => pressed(event);
    window.addEventListener("keydown", press);
    return () => window.removeEventListener("keydown", press);
  }, []);
}

// Asks before unsaved work is left: by a link of the site, or by closing the tab.

/** Whether work may be replaced by other: saved, or given up when asked. */
export function mayReplace(unsaved: boolean): boolean {
  return !unsaved || window.confirm("You have unsaved work. Open another file anyway?");
}

export function useUnsaved(unsaved: boolean): void {
  useBlocker({
    shouldBlockFn: () => unsaved && !window.confirm("You have unsaved work. Leave anyway?"),
    enableBeforeUnload: () => unsaved,
  });
}
