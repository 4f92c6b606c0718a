import { describe, expect, it } from "vitest";
import { cellRows, marginRows, cellLabels, cellPlot, countTicks } from "../../src/admin/results/plots";
import { ago, labelOfOrigin, counted } from "../../src/admin/ui/format";
import { seriesLabels, seriesPlot } from "../../src/admin/kinds/threshold/plots";
import { csvText } from "../../src/admin/ui/figure-files";

const factor = (name: string, ...levels: [string, string][]) => ({
  name,
  label: name,
  levels: levels.map(([level, label]) => ({ name: level, label })),
});
const FACTORS = [factor("character", ["a", "Anna"], ["b", "Bert"]), factor("speed", ["100", "100 ms"], ["20", "20 ms"])];

describe("figures that are saved", () => {
  it("have their numbers under the labels of the study, in declared order", () => {
    const mean = (speed: string, value: number) => ({
      ...{ levels: { speed }, mean: value, se_within: 0.5, low: value - 1, high: value + 1, participants: 3, people: [value] },
    });
    const rows = marginRows({ factors: ["speed"], means: [mean("20", 2), mean("100", 1.5)] }, FACTORS);
    expect(csvText(rows)).toBe("speed,mean,se_within,ci95_low,ci95_high,participants\r\n100 ms,1.5,0.5,0.5,2.5,3\r\n20 ms,2,0.5,1,3,3\r\n");
    const cells = [
      { cell: "b/20", ratings: 1, counts: [1, 0] },
      { cell: "a/20", ratings: 2, counts: [0, 2] },
    ];
    const labels = cellLabels(["b/20", "a/20"], FACTORS);
    const shown = cellRows({ cells, bins: [1, 2] } as Parameters<typeof cellRows>[0], labels);
    expect(shown.map((row) => [row["cell"], row["answer 2"]])).toEqual([
      ["Anna", 2],
      ["Bert", 0],
    ]);
  });

  it("hold nothing that a spreadsheet would run, and keep commas and quotes", () => {
    expect(csvText([{ a: "=1+1", b: 'say "so", then', c: -1.5 }])).toBe('a,b,c\r\n\'=1+1,"say ""so"", then",-1.5\r\n');
  });
});

describe("counts", () => {
  it("have ticks at whole numbers alone, at most seven", () => {
    expect(countTicks(1)).toEqual([0, 1]);
    expect(countTicks(6)).toEqual([0, 1, 2, 3, 4, 5, 6]);
    expect(countTicks(7)).toEqual([0, 2, 4, 6]);
    expect(countTicks(31)).toEqual([0, 10, 20, 30]);
    for (const largest of [13, 99, 1234, 98_765]) expect(countTicks(largest).length).toBeLessThanOrEqual(7);
  });
});

describe("labels of cells", () => {
  it("are in declared order, with the factors in which the cells differ", () => {
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

describe("the answers in each cell", () => {
  const of = (bins: number[]) =>
    cellPlot({ bins, cells: [{ cell: "a", ratings: 1, counts: bins.map(() => 0) }] } as unknown as Parameters<typeof cellPlot>[0], []);

  it("name every point of a scale, and of a slider's many bins as many as fit a narrow screen", () => {
    expect(of([1, 2, 3, 4, 5, 6, 7]).x).toEqual({ label: "answer", ticks: [1, 2, 3, 4, 5, 6, 7] });
    const bins = Array.from({ length: 20 }, (_, bin) => 5 * bin);
    expect(of(bins).x).toEqual({ label: "answer, from the number on, 5 wide", ticks: [0, 10, 20, 30, 40, 50, 60, 70, 80, 90] });
  });
});

describe("times", () => {
  it("are just now, not 0 s ago", () => {
    const at = (seconds: number) => ago("2026-01-01T00:00:00Z", new Date(Date.UTC(2026, 0, 1, 0, 0, seconds)).toISOString());
    expect([at(0), at(4), at(5), at(90)]).toEqual(["just now", "just now", "5 s ago", "2 min ago"]);
  });
});

describe("counts", () => {
  it("have their plural", () => {
    expect([0, 1, 1200].map((number) => counted(number, "run"))).toEqual(["0 runs", "1 run", "1,200 runs"]);
    expect(labelOfOrigin("participant")).toBe("Participants");
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

describe("the figure of a series", () => {
  const stimuli = [
    { value: 100, second: 0, n: 4, positive: 1 },
    { value: 100, second: 1, n: 2, positive: 2 },
  ];
  const series = { stimuli, mean: 110, thresholds: [100, 120] } as unknown as Parameters<typeof seriesPlot>[0];

  it("over two factors shows stimuli by both numbers, and the share by colour", () => {
    const plot = seriesPlot(series, { title: "Speed", second: { title: "Shape", middle: 0.5 } }, "yes");
    expect([plot.x?.label, plot.y?.label, plot.color?.label]).toEqual(["Speed", "Shape", "yes"]);
    expect(plot.y?.ticks).toEqual([0, 1]);
  });

  it("over one shows the share above the stimulus", () => {
    const plot = seriesPlot(series, { title: "Speed", second: null }, "yes");
    expect([plot.x?.label, plot.y?.label]).toEqual(["Speed", "yes"]);
  });
});
