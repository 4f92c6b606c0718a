/** Keys pressed anywhere on the page, without repeats, modifiers, and what belongs to a field being typed in. */

const TYPING = "input, textarea, select, [contenteditable]";
const PRESSABLE = "button, a[href], summary, [role=button]";

/** @param own a button whose Space and Enter are the handler's, at the press: as a click Space comes when it is released. */
export function listenKeys(handler: (event: KeyboardEvent) => void, signal: AbortSignal, own?: Element): void {
  const listener = (event: KeyboardEvent): void => {
    const target = event.target instanceof Element ? event.target : null;
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || target?.closest(TYPING)) return;
    // Enter and Space on a focused button are its click; a dialog has keys of its own.
    const button = target?.closest(PRESSABLE);
    if (isStartKey(event) && button && button !== own) return;
    if (document.querySelector("dialog[open]")) return;
    handler(event);
  };
  document.addEventListener("keydown", listener, { signal });
}

export function isStartKey(event: KeyboardEvent): boolean {
  return event.key === " " || event.key === "Enter";
}

/** From its press to its release a key clicks nothing, whatever has the focus by then. */
export function clickNothing(press: KeyboardEvent): void {
  press.preventDefault();
  const held = new AbortController();
  const later = (event: KeyboardEvent): void => {
    if (event.key !== press.key) return;
    // A release can go to another window: the next press is a new one.
    if (event.type === "keyup" || !event.repeat) held.abort();
    if (event.type === "keyup" || event.repeat) event.preventDefault();
  };
  for (const type of ["keydown", "keyup"] as const) window.addEventListener(type, later, { signal: held.signal, capture: true });
}
