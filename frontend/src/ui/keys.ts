/** Keys pressed anywhere on the page, without repeats, modifiers, and what belongs to a field being typed in. */

import { digitValue } from "./digits";

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

type Key = Pick<KeyboardEvent, "key" | "code" | "shiftKey">;
/** What a key is called while an input method has it, or where a browser does not know it. */
const ONE = /^.$/u;
const OTHER_LETTER = /^\p{L}$/u;
const UNNAMED = ["Process", "Unidentified", "Dead", ""];

/**
 * What a key means on every layout: digits of any script are 0 to 9, as is the top row where it writes something else
 * (AZERTY, Czech); a key that an input method has, or a letter of another script, is the one of its place.
 */
export function keyOf({ key, code, shiftKey }: Key): string {
  const digit = digitValue(key);
  if (digit !== null) return String(digit);
  const [, top, numpad, letter] = /^(?:Digit(\d)|Numpad(\d)|Key([A-Z]))$/.exec(code) ?? [];
  const unnamed = UNNAMED.includes(key);
  if (top && (unnamed || (!shiftKey && ONE.test(key)))) return top;
  if (numpad && unnamed) return numpad;
  if (letter && (unnamed || (OTHER_LETTER.test(key) && !/[a-z]/i.test(key)))) return letter.toLowerCase();
  if (key === "\u3000" || (unnamed && code === "Space")) return " ";
  if (unnamed && (code === "Enter" || code === "NumpadEnter")) return "Enter";
  return unnamed && code.startsWith("Arrow") ? code : key;
}

export function isStartKey(event: Key): boolean {
  return [" ", "Enter"].includes(keyOf(event));
}

/** From its press to its release a key clicks nothing, whatever has the focus by then. */
export function clickNothing(press: KeyboardEvent): void {
  press.preventDefault();
  const held = new AbortController();
  const later = (event: KeyboardEvent): void => {
    // By its place: an input method names a key otherwise when it goes up.
    if (press.code ? event.code !== press.code : event.key !== press.key) return;
    // A release can go to another window: the next press is a new one.
    if (event.type === "keyup" || !event.repeat) held.abort();
    if (event.type === "keyup" || event.repeat) event.preventDefault();
  };
  for (const type of ["keydown", "keyup"] as const) window.addEventListener(type, later, { signal: held.signal, capture: true });
}
