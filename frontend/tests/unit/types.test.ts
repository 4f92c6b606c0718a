import { describe, expect, it } from "vitest";
import declared from "../../src/api/declaration.json";

/** The constants of `tag` in the tables that a key of the declaration may hold. */
function namesOf(tag: string, has: string): string[] {
  const tables = Object.values(declared.schema.$defs) as { properties?: Record<string, { const?: string }> }[];
  const named = tables.filter(({ properties }) => properties?.[has]).map(({ properties }) => properties?.[tag]?.const);
  return named.filter((name) => name !== undefined).sort();
}

function filesIn(paths: string[]): string[] {
  return paths.map((path) => /(\w+)\.ts$/.exec(path)?.[1] ?? path).sort();
}

describe("what the page draws by name", () => {
  it("has a module for every type of field", () => {
    const files = Object.keys(import.meta.glob("../../src/participant/screens/fields/*.ts"));
    const folders = ["field", "options"];
    expect(filesIn(files).filter((name) => !folders.includes(name))).toEqual(namesOf("type", "required"));
  });
  it("has a module for every type of scale", () => {
    const files = Object.keys(import.meta.glob("../../src/participant/trials/scales/*.ts"));
    expect(filesIn(files)).toEqual(namesOf("type", "not_applicable"));
  });
});
