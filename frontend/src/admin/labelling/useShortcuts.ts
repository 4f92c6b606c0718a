/** Keys of a page. They rest while a person types into a field. */

import { useEffect, useEffectEvent } from "react";

export type Shortcuts = Readonly<Record<string, (event: KeyboardEvent) => void>>;

/** Name of a pressed key: "n", "arrowleft", "ctrl+z", "ctrl+shift+z"; Shift alone is told by the event. */
function nameOf(event: KeyboardEvent): string {
  const key = event.key.toLowerCase();
  if (!event.ctrlKey && !event.metaKey) return key;
  return `ctrl+${event.shiftKey && !key.startsWith("arrow") ? "shift+" : ""}${key}`;
}

function isTyping(target: EventTarget | null): boolean {
  return target instanceof Element && target.closest("input, textarea, select, [contenteditable], [role=dialog]") !== null;
}

export function useShortcuts(shortcuts: Shortcuts): void {
  const pressed = useEffectEvent((event: KeyboardEvent): void => {
    const action = shortcuts[nameOf(event)];
    if (action === undefined || event.defaultPrevented || event.altKey || isTyping(event.target)) return;
    event.preventDefault();
    action(event);
  });
  useEffect(() => {
    const press = (event: KeyboardEvent): void => pressed(event);
    window.addEventListener("keydown", press);
    return () => window.removeEventListener("keydown", press);
  }, []);
}
