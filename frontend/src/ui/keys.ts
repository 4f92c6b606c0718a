/** Keys pressed anywhere on the page, without repeats, modifiers, and what belongs to a field being typed in. */

const TYPING = "input, textarea, select, [contenteditable]";
const PRESSABLE = "button, a[href], summary, [role=button]";

export function listenKeys(handler: (event: KeyboardEvent) => void, signal: AbortSignal): void {
  const listener = (event: KeyboardEvent): void => {
    const target = event.target instanceof Element ? event.target : null;
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || target?.closest(TYPING)) return;
    // Enter and Space on a focused button are its click; a dialog has keys of its own.
    if ((event.key === "Enter" || event.key === " ") && target?.closest(PRESSABLE)) return;
    if (document.querySelector("dialog[open]")) return;
    handler(event);
  };
  document.addEventListener("keydown", listener, { signal });
}

export function isStartKey(event: KeyboardEvent): boolean {
  return event.key === " " || event.key === "Enter";
}
