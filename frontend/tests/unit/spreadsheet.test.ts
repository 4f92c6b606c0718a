import { describe, expect, it } from "vitest";

import { csvField, guardedText, parseTable } from "../../src/labelling/csv";

const FORMULAS = ["=1", "+1+1", "-1+cmd", "@SUM(A1)", "\t=1", "＝1+1", "＠SUM(A1)", "﹦1"];

describe("texts that a spreadsheet would run", () => {
  it.each(FORMULAS)("are guarded and come back: %j", (cell) => {
    expect(guardedText(cell)).toMatch(/^'/);
    const written = `a,b\n${csvField(cell)},1\n`;
    expect(parseTable("t.csv", written).rows[0]?.[0]).toBe(cell);
  });

  it.each(["-1.5", "+2", "1e-3", "", "a=b", "well ;-)", "1;-2"])("other texts stay: %j", (cell) => {
    expect(guardedText(cell)).toBe(cell);
  });

  it("parts after a semicolon are guarded", () => {
    expect(guardedText("thanks;=1+1")).toBe("thanks;'=1+1");
  });
});
