/** Digits as people write them: of every script, full-width ones, with marks of direction between. */

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
