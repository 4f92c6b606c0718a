/** The message catalogue: every sentence the page itself says. Study texts come from the declaration. */
import { messages as en, type Messages } from "./languages/en";

export type MessageKey = keyof Messages;
export type Translate = (key: MessageKey, values?: Record<string, string | number>) => string;

/** A file a language, named by its tag: nothing else needs to know of it. */
const files = import.meta.glob<Messages>("./languages/*.ts", { eager: true, import: "messages" });
const catalogues: Record<string, Messages> = Object.fromEntries(Object.entries(files).map(([path, messages]) => [tagIn(path), messages]));

/** Languages that the page speaks itself. English first: it stands in for all others. */
export const SHIPPED = ["en", ...Object.keys(catalogues).filter((tag) => tag !== "en")];

const RIGHT_TO_LEFT = new Set(["ar", "dv", "fa", "he", "ku", "ps", "sd", "ug", "ur", "yi"]);

function tagIn(path: string): string {
  return path.replace(/^.*\/|\.ts$/g, "");
}

/** Messages in `language`, in English where no catalogue of that language is shipped. */
export function translator(language: string): Translate {
  const messages = catalogues[language] ?? catalogues[language.slice(0, 2)] ?? en;
  return (key, values = {}) => messages[key].replace(/\{(\w+)\}/g, (whole, name: string) => String(values[name] ?? whole));
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
export function preferred(offered: string[], wanted: readonly string[]): string {
  const found = wanted.map((tag) => offered.find((one) => one === tag || one === tag.slice(0, 2))).find(Boolean);
  return found ?? offered[0] ?? "en";
}
