/** Every language file of the participant page has the keys of the English one, with forms where that counts. Part of `npm run lint`. */
import { readdirSync, readFileSync } from "node:fs";

const folder = new URL("../src/i18n/languages/", import.meta.url);
const messagesIn = (file) => JSON.parse(readFileSync(new URL(file, folder), "utf8"));
const shape = (message) => (typeof message?.by === "string" && typeof message.other === "string" ? "counted" : typeof message);
const english = messagesIn("en.json");

for (const file of readdirSync(folder)) {
  const messages = messagesIn(file);
  const missing = Object.keys(english).filter((key) => !(key in messages));
  const unknown = Object.keys(messages).filter((key) => !(key in english));
  const unlike = Object.keys(english).filter((key) => key in messages && shape(messages[key]) !== shape(english[key]));
  const faults = { "missing keys": missing, "unknown keys": unknown, "a text where a number is counted, or the reverse": unlike };
  for (const [fault, keys] of Object.entries(faults)) {
    if (!keys.length) continue;
    console.error(`src/i18n/languages/${file}: ${fault}: ${keys.join(", ")}; expected those of en.json`);
    process.exitCode = 1;
  }
}
