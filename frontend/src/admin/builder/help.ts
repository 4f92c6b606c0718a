/** Help in the words of the page: the declaration's own texts name keys of the TOML, the forms show labels. */

import { labelOf } from "./data";
import { EXPERIMENT, type Schema } from "./schema";

const KEYS = new Set([EXPERIMENT, ...Object.values(EXPERIMENT.$defs ?? {})].flatMap((table) => Object.keys(table.properties ?? {})));
const VALUES = new Set(Object.values(EXPERIMENT.$defs ?? {}).flatMap(valuesIn));
/** The families of keys that playback's help speaks of at once. */
const FAMILY = /`([a-z]+)_\*`/g;

function valuesIn(schema: Schema): string[] {
  return Object.values(schema.properties ?? {}).flatMap((key) => [
    ...(key.enum ?? []),
    ...(typeof key.const === "string" ? [key.const] : []),
  ]);
}

const quoted = (words: string) => `“${words}”`;
const inWords = (value: string) => value.replaceAll("_", " ");

/** `pointer_delay_ms` reads “Pointer delay (ms)”, [[trial.scales]] “Scales”, `start = "fixation"` “Start” is “fixation”. */
export function helpOf(schema: Schema): string {
  return (schema.description ?? "")
    .replaceAll(/`(\w+) = "?([\w ]+)"?`/g, (_, key: string, value: string) => `${quoted(labelOf(key))} is ${quoted(inWords(value))}`)
    .replaceAll(/\[+([a-z]\w*(?:\.\w+)*)\]+/g, (_, path: string) =>
      quoted(labelOf(path.split(".").findLast((part) => KEYS.has(part)) ?? path)),
    )
    .replaceAll(FAMILY, (_, stem: string) => quoted(`${labelOf(stem)} …`))
    .replaceAll(/`(\w+)`/g, (_, word: string) => (VALUES.has(word) ? inWords(word) : KEYS.has(word) ? quoted(labelOf(word)) : word))
    .replaceAll(/”\s+“/g, ", ")
    .replaceAll("`", "")
    .replaceAll(/\s+/g, " ")
    .trim();
}
