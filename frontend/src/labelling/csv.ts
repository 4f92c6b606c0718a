/** CSV tables as the programs write them: a header, commas, quotes where a field needs them. */

/** What is wrong with a table, in one line. */
export class TableProblem extends Error {
  override name = "TableProblem";
}

export interface Table {
  readonly name: string;
  readonly header: readonly string[];
  readonly rows: readonly (readonly string[])[];
}

const NUMBER = /^\s*[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?\s*$/i;

/** A plus or minus counts where an operand may follow: the ";-)" of a comment is not a formula. */
const INNER = /^([=@＝＠﹦﹫]|[+\-＋－﹢﹣][^)\]/|])/;

/** The text of a cell with an apostrophe where a spreadsheet would run it as a formula (table_files/formulas.py). */
export function guardedText(text: string): string {
  const whole = /^[=+\-@＝＋－＠﹦﹢﹣﹫\t\r\n]/.test(text) && !NUMBER.test(text) ? `'${text}` : text;
  // Without lookbehind, which Safari before 16.4 cannot read: the parts keep their separators.
  return whole
    .split(/([;\t\r\n])/)
    .map((part, index) => (index > 0 && INNER.test(part) && !NUMBER.test(part) ? `'${part}` : part))
    .join("");
}

/** The text that `guardedText` was given; any other text as it is. */
function plainText(text: string): string {
  const plain = text.replaceAll(/(^|[;\t\r\n])'(?=[=+\-@＝＋－＠﹦﹢﹣﹫\t\r\n])/g, "$1");
  return plain !== text && guardedText(plain) === text ? plain : text;
}

function fieldsOf(line: string): string[] {
  if (!line.includes('"')) return line.split(",");
  const fields: string[] = [];
  for (const [whole, quoted, plain] of `,${line}`.matchAll(/,\s*(?:"((?:[^"]|"")*)"\s*|([^,]*))/g)) {
    if (whole !== "") fields.push(quoted === undefined ? (plain ?? "") : quoted.replaceAll('""', '"'));
  }
  return fields;
}

/** Read a table; blanks round names and values are dropped. */
export function parseTable(name: string, text: string): Table {
  const lines = text
    .replace(/^\uFEFF/, "")
    .split(/\r?\n/)
    .filter((line) => line.trim() !== "");
  const [first, ...rest] = lines;
  if (first === undefined || rest.length === 0) {
    throw new TableProblem(`${name}: expected a CSV table with a header line and rows`);
  }
  return {
    name,
    header: fieldsOf(first).map((field) => plainText(field.trim())),
    rows: rest.map((line) => fieldsOf(line).map((field) => plainText(field.trim()))),
  };
}

/** Index of a column; a TableProblem that lists the columns where it is not there. */
export function requiredColumn(table: Table, column: string): number {
  const index = table.header.indexOf(column);
  if (index >= 0) return index;
  throw new TableProblem(`${table.name}: expected a column '${column}', found ${table.header.join(", ")}`);
}

/** A whole number from 0 in a row (counted from 0); a TableProblem that names the row otherwise. */
export function wholeAt(table: Table, row: number, index: number): number {
  const text = table.rows[row]?.[index] ?? "";
  const value = Number(text);
  if (text !== "" && Number.isInteger(value) && value >= 0) return value;
  throw new TableProblem(`${table.name} row ${row + 2}: ${table.header[index] ?? "value"} must be a whole number, got '${text}'`);
}

/** A field as CSV writes it. */
export function csvField(value: string | number): string {
  const plain = String(value).replaceAll(/[\r\n]+/g, " ");
  const text = typeof value === "number" ? plain : guardedText(plain);
  return /[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
