/** The message catalogue: every sentence the page itself says. Study texts come from the declaration. */
import { loadModule } from "../ui/load-module";
import { formOf, type MessageKey, type Messages } from "./message";

export type { MessageKey };
export type Translate = (key: MessageKey, values?: Record<string, string | number>) => string;

/** One file per language, named by its tag: nothing else needs to know of it. A page loads those it speaks. */
const files = import.meta.glob<Messages>("./languages/*.json", { import: "default" });
const loaders = Object.fromEntries(Object.entries(files).map(([path, load]) => [tagIn(path), load]));
const catalogues: Partial<Record<string, Messages>> = {};

/** Languages of the page itself. English comes first: it is the fallback for all others. */
export const SHIPPED = ["en", ...Object.keys(loaders).filter((tag) => tag !== "en")];

const RIGHT_TO_LEFT = new Set(["ar", "dv", "fa", "he", "ku", "ps", "sd", "ug", "ur", "yi"]);

function tagIn(path: string): string {
  return path.replace(/^.*\/|\.json$/g, "");
}

function shipped(language: string): string {
  return [language, language.slice(0, 2)].find((tag) => SHIPPED.includes(tag)) ?? "en";
}

/** Fetch the messages of `language`, English where none are shipped. What cannot be had is tried again, then done without. */
export async function loadMessages(language: string): Promise<void> {
  const tag = shipped(language);
  const load = loaders[tag];
  if (load && !catalogues[tag]) catalogues[tag] = await loadModule(load).catch(() => undefined);
}

/** Messages in `language` as `loadMessages` has fetched them; those of another language where it could not. */
export function translator(language: string): Translate {
  const tag = catalogues[shipped(language)] ? shipped(language) : (Object.keys(catalogues)[0] ?? "en");
  const messages = catalogues[tag];
  const rules = new Intl.PluralRules(tag);
  return (key, values = {}) =>
    formOf(messages?.[key] ?? key, values, rules).replace(/\{(\w+)\}/g, (whole, name: string) => String(values[name] ?? whole));
}

export function direction(language: string): "rtl" | "ltr" {
  return RIGHT_TO_LEFT.has(language.slice(0, 2)) ? "rtl" : "ltr";
}

/** The name of a language in itself: Deutsch for de. */
export function languageName(language: string): string {
  return new Intl.DisplayNames([language], { type: "language" }).of(language) ?? language;
}

/** The text of a declared translation in `language`, else in the first language it has. */
export function pick(text: Record<string, string>, language: string): string {
  return text[language] ?? text[language.slice(0, 2)] ?? text["en"] ?? Object.values(text)[0] ?? "";
}

/** The language to start with: the browser's first that the study has, else the study's first. */
export function preferred(offered: string[], acceptedLanguages: readonly string[]): string {
  const match = acceptedLanguages.map((tag) => offered.find((one) => one === tag || one === tag.slice(0, 2))).find(Boolean);
  return match ?? offered[0] ?? "en";
}
