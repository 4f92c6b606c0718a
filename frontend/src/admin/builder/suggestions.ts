/** Values that a key of text may well take, from what is declared elsewhere: names of factors, forms, cells. */

import { type Data, keyName, listAt, type Path, tableAt, textAt } from "./data";

const KNOWN: Record<string, string[]> = {
  languages: ["en", "de"],
  "render.character": ["alder@8", "birch@6", "cedar@4", "hazel@5", "cartoon"],
  "render.profile": ["real", "phases", "model", "SL", "AL", "SL_ease", "AL_ease"],
};
const FACTORS = ["exemplars.own_per", "blocks.split_by", "analysis.factors", "analysis.pairs", "trial.pairs.factor"];
const CELLS = ["trial.reference.cell", "trial.pairs.cells.cell", "trial.pairs.cells.other"];

function namesOf(elements: readonly unknown[]): string[] {
  return elements.map((element) => textAt(element, ["name"])).filter((name) => name !== "");
}

function factorNames(data: Data): string[] {
  return namesOf(listAt(data, ["factors"]));
}

/** Names of the cells: every level with every other, as the design names them. */
function cellNames(data: Data): string[] {
  const levels = listAt(data, ["factors"]).map((factor) => namesOf(listAt(factor, ["levels"])));
  return levels.reduce<string[]>(
    (cells, names) => cells.flatMap((cell) => names.map((name) => (cell === "" ? name : `${cell}/${name}`))).slice(0, 500),
    [""],
  );
}

/** What may be offered at this place; empty where anything goes. */
export function suggestionsFor(data: Data, path: Path): string[] {
  const key = keyName(path);
  const end = KNOWN[key] ?? KNOWN[key.replace(/^factors\.levels\./, "")];
  if (end !== undefined) return end;
  if (FACTORS.includes(key) || key.endsWith(".factor") || key.endsWith(".factors")) return factorNames(data);
  if (CELLS.includes(key)) return cellNames(data);
  if (key.startsWith("screening.")) return ofForms(data, key, path.slice(0, 2));
  return [];
}

function ofForms(data: Data, key: string, rule: Path): string[] {
  const forms = listAt(data, ["forms"]);
  if (key === "screening.form") return namesOf(forms);
  const chosen = tableAt(data, rule);
  const fields = listAt(
    forms.find((form) => textAt(form, ["name"]) === chosen["form"]),
    ["fields"],
  );
  if (key === "screening.field") return namesOf(fields);
  const field = fields.find((one) => textAt(one, ["name"]) === chosen["field"]);
  return key === "screening.refused" ? listAt(field, ["options"]).map((option) => textAt(option, ["value"])) : [];
}
