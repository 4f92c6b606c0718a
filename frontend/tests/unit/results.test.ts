import { describe, expect, it } from "vitest";
import { cellLabels } from "../../src/admin/results/plots";
import { seriesLabels } from "../../src/admin/results/threshold-plots";

const factor = (name: string, ...levels: [string, string][]) => ({
  name,
  label: name,
  levels: levels.map(([level, label]) => ({ name: level, label })),
});
const FACTORS = [factor("character", ["a", "Anna"], ["b", "Bert"]), factor("speed", ["100", "100 ms"], ["20", "20 ms"])];

describe("labels of cells", () => {
  it("stand in declared order, of the factors in which the cells differ", () => {
    expect([...cellLabels(["b/20", "a/20", "b/100", "a/100"], FACTORS)]).toEqual([
      ["a/100", "Anna, 100 ms"],
      ["a/20", "Anna, 20 ms"],
      ["b/100", "Bert, 100 ms"],
      ["b/20", "Bert, 20 ms"],
    ]);
    expect([...cellLabels(["b/20", "b/100", "b/20"], FACTORS).values()]).toEqual(["100 ms", "20 ms"]);
  });

  it("are the cell itself where there is one cell, or no such factor is known", () => {
    expect([...cellLabels(["b/20"], FACTORS).values()]).toEqual(["b/20"]);
    expect([...cellLabels(["b/20"], []).values()]).toEqual(["b/20"]);
  });
});

describe("labels of series", () => {
  const series = (name: string, levels: Record<string, string>) =>
    ({ name, levels }) as unknown as Parameters<typeof seriesLabels>[0][number];

  it("are those of their levels, with the name where two series have the same", () => {
    const every = [series("s1", { character: "a" }), series("s2", { character: "b" }), series("again", { character: "b" })];
    expect([...seriesLabels(every, FACTORS).values()]).toEqual(["Anna", "Bert (s2)", "Bert (again)"]);
    expect([...seriesLabels([series("only", {})], FACTORS).values()]).toEqual(["only"]);
  });
});
