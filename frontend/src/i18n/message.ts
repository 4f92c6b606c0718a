/** A sentence of the page: a text, or the forms it takes for the number that it counts. */
import type english from "./languages/en.json";

/** `by` names the value that is counted; which form a number takes is the language's own rule (Intl.PluralRules). */
type Plural = { by: string; other: string } & Partial<Record<Intl.LDMLPluralRule, string>>;
export type Message = string | Plural;

/** Every language file has the keys of the English one; `npm run lint` refuses others (scripts/check_languages.mjs). */
export type MessageKey = keyof typeof english;
export type Messages = Record<MessageKey, Message>;

export function formOf(message: Message, values: Record<string, string | number>, rules: Intl.PluralRules): string {
  if (typeof message === "string") return message;
  return message[rules.select(Number(values[message.by]))] ?? message.other;
}
