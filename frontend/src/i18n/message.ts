/** A sentence of the page: a text, or the forms it takes for the number that it counts. */

/** `by` names the value that is counted; which form a number takes is the language's own rule (Intl.PluralRules). */
export type Plural = { by: string; other: string } & Partial<Record<Intl.LDMLPluralRule, string>>;
export type Message = string | Plural;

export function formOf(message: Message, values: Record<string, string | number>, rules: Intl.PluralRules): string {
  if (typeof message === "string") return message;
  return message[rules.select(Number(values[message.by]))] ?? message.other;
}
