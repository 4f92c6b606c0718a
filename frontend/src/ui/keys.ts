/** Keys and presses: what a key means on every layout, and whether a press was meant for what is on the screen. */

// Digits as people write them: of every script, full-width ones, with marks of direction between.

const DIGIT = /\p{Nd}/u;
const ONE_DIGIT = /^\p{Nd}$/u;
const DIGITS = /\p{Nd}/gu;
/** Blanks, and marks that say in which direction text runs. */
const INVISIBLE = /[\s\u200e\u200f\u061c\u2066-\u2069]/g;
const MINUS = /[\u2212\ufe63\uff0d\u2010\u2011]/g;
const PLUS = /[\ufe62\uff0b]/g;
const POINT = /[\u066b\uff0e]/g;

/** The digit's value; null where the character is none. */
export function digitValue(character: string): number | null {
  if (!ONE_DIGIT.test(character)) return null;
  // Unicode has the digits of each script in order, ten after ten: the number of digits before it, in tens.
  const code = character.codePointAt(0) ?? 0;
  let before = 0;
  while (before < code && DIGIT.test(String.fromCodePoint(code - before - 1))) before += 1;
  return before % 10;
}

/** The same text with the digits 0 to 9, without what only sets it. */
export function plainNumber(text: string): string {
  const plain = text.replace(INVISIBLE, "").replace(MINUS, "-").replace(PLUS, "+").replace(POINT, ".");
  return plain.replace(DIGITS, (digit) => String(digitValue(digit)));
}

// Keys pressed anywhere on the page, without repeats, modifiers, and what belongs to a field being typed in.

const TYPING = "input, textarea, select, [contenteditable]";
const PRESSABLE = "button, a[href], summary, [role=button]";

/** @param own a button whose Space and Enter are the handler's, at the press: as a click Space comes when it is released. */
export function listenKeys(handler: (event: KeyboardEvent) => void, signal: AbortSignal, own?: Element): void {
  const listener = (event: KeyboardEvent): void => {
    const target = event.target instanceof Element ? event.target : null;
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || target?.closest(TYPING)) return;
    // Enter and Space on a focused button are its click; a dialog has its own keys.
    const button = target?.closest(PRESSABLE);
    if (isStartKey(event) && button && button !== own) return;
    if (document.querySelector("dialog[open]")) return;
    handler(event);
  };
  document.addEventListener("keydown", listener, { signal });
}

type Key = Pick<KeyboardEvent, "key" | "code" | "shiftKey">;
const ONE = /^.$/u;
const OTHER_LETTER = /^\p{L}$/u;
/** What a key is called while an input method has it, or where a browser does not know it. */
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

// Whether a press was meant for what is on the screen. A mouse that still lies where it pressed last chooses nothing:
// it must have moved since, or the declared delay must have passed. Keys, touch and pens aim afresh each time.

const MOVED_PX = 3;

export class MeantPress {
  private readonly from_ms = performance.now();
  private travelled_px = 0;
  private last: { x: number; y: number } | null = null;

  constructor(
    private readonly delay_ms: number,
    signal: AbortSignal,
  ) {
    document.addEventListener("pointermove", (event) => this.moved(event), { signal, capture: true, passive: true });
  }

  allows(event: Event): boolean {
    if (!(event instanceof PointerEvent) || event.pointerType !== "mouse") return true;
    return this.travelled_px >= MOVED_PX || performance.now() - this.from_ms >= this.delay_ms;
  }

  /** Browsers also report a move where the page has moved under a resting pointer: its place then stays the same. */
  private moved({ pointerType, screenX: x, screenY: y, movementX, movementY }: PointerEvent): void {
    if (pointerType !== "mouse") return;
    const step = this.last ? Math.hypot(x - this.last.x, y - this.last.y) : Math.hypot(movementX, movementY);
    this.travelled_px += step;
    this.last = { x, y };
  }
}

/** Which way scales run on this page: as it is read, unless the study keeps them as in languages read from left to right. */
export function scaleDirection(): string {
  return document.documentElement.dataset["scales"] === "same" ? "ltr" : document.dir;
}
