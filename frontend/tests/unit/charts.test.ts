/** What the charts of the results page draw: every bar, point and cell as Observable Plot computes it from the data. */
import type * as Plot from "@observablehq/plot";
import { describe, expect, it } from "vitest";
import { choicePlot, levelPlot } from "../../src/admin/kinds/paired_comparison/plots";
import { cellPlot, delayPlot, marginPlot, marginRows, timePlot } from "../../src/admin/results/plots";
import { seriesPlot } from "../../src/admin/kinds/threshold/plots";
import { cellTracePlot, tracesPlot } from "../../src/admin/kinds/continuous_rating/plots";

interface DrawnMark {
  ariaLabel?: string;
  initialize?: () => { channels: Record<string, { value: ArrayLike<unknown>; scale: string | null }> };
}

/** The values of all marks of a kind, a row per bar, point or cell. */
function drawn(plot: Plot.PlotOptions, kind: string): Record<string, unknown>[] {
  const marks = (plot.marks ?? []) as unknown as DrawnMark[];
  return marks
    .filter((mark) => mark.ariaLabel === kind && mark.initialize !== undefined)
    .flatMap((mark) => {
      const channels = Object.entries(mark.initialize?.().channels ?? {});
      const length = Math.max(0, ...channels.map(([, { value }]) => value.length));
      return Array.from({ length }, (_, row) => Object.fromEntries(channels.map(([name, { value }]) => [name, value[row]])));
    });
}

const factor = (name: string, ...levels: [string, string][]) => ({
  name,
  label: name,
  levels: levels.map(([level, label]) => ({ name: level, label })),
});
const FACTORS = [factor("character", ["a", "Anna"], ["b", "Bert"]), factor("speed", ["100", "100 ms"], ["20", "20 ms"])];
const SCALE = { scale: { name: "rating", minimum: 1, maximum: 7 } } as Parameters<typeof marginPlot>[1];

describe("the chart of means", () => {
  const mean = (levels: Record<string, string>, value: number, half: number | null, people: number[] = []) => ({
    levels,
    mean: value,
    se_within: half === null ? null : half / 4,
    low: half === null ? null : value - half,
    high: half === null ? null : value + half,
    participants: 3,
    people,
  });
  const means = [mean({ speed: "20" }, 4.25, 0.5, [3, 6.5]), mean({ speed: "100" }, 2.5, 0.125, [2.25])];

  it("has bars from end to end of the interval, about points at the means, and participants behind them", () => {
    const plot = marginPlot({ factors: ["speed"], means }, SCALE, FACTORS);
    const dots = drawn(plot, "dot").map(({ x, y }) => [x, y]);
    expect(dots.slice(0, 3)).toEqual([
      ["20 ms", 3],
      ["100 ms", 2.25],
      ["20 ms", 6.5],
    ]);
    // The ends of the bars, which show where the point of the mean hides a short one.
    expect(dots.slice(3, -2)).toEqual([
      ["20 ms", 3.75],
      ["100 ms", 2.375],
      ["20 ms", 4.75],
      ["100 ms", 2.625],
    ]);
    expect(dots.slice(-2)).toEqual([
      ["20 ms", 4.25],
      ["100 ms", 2.5],
    ]);
    expect(drawn(plot, "rule").map(({ x, y1, y2 }) => [x, y1, y2])).toEqual([
      ["20 ms", 3.75, 4.75],
      ["100 ms", 2.375, 2.625],
    ]);
    expect(plot.x?.domain).toEqual(["100 ms", "20 ms"]);
    expect(plot.y?.domain).toEqual([1, 7]);
  });

  it("says of how many people it is, what the bars are, and how many participants it shows", () => {
    const caption = (of: typeof means) => marginPlot({ factors: ["speed"], means: of }, SCALE, FACTORS).caption;
    expect(caption(means)).toBe(
      "N = 3. Small points: participants (2 shown). Large points: their means. Bars: 95% within-participant CI (Cousineau-Morey).",
    );
    expect(caption([mean({ speed: "20" }, 4.25, null)])).toContain("No bars: an interval needs at least two participants.");
    expect(caption([mean({ speed: "20" }, 4.25, 0)])).toContain("all participants differ by the same amount between conditions");
  });

  it("keeps the axis to the scale, and says that bars are cut at its ends", () => {
    const wide = [mean({ speed: "20" }, 6.5, 1), mean({ speed: "100" }, 1.5, 2)];
    const plot = marginPlot({ factors: ["speed"], means: wide }, SCALE, FACTORS);
    expect(plot.y?.domain).toEqual([1, 7]);
    expect(drawn(plot, "rule").map(({ y1, y2 }) => [y1, y2])).toEqual([
      [5.5, 7],
      [1, 3.5],
    ]);
    expect(plot.caption).toContain("Bars are cut at the ends of the scale; the CSV has the whole intervals.");
    expect(marginPlot({ factors: ["speed"], means }, SCALE, FACTORS).caption).not.toContain("cut");
    expect(marginRows({ factors: ["speed"], means: wide }, FACTORS).map((row) => row["ci95_high"])).toContain(7.5);
  });

  it("has bars without length where there is no interval", () => {
    const plot = marginPlot({ factors: ["speed"], means: [mean({ speed: "20" }, 4.25, null)] }, SCALE, FACTORS);
    expect(drawn(plot, "rule").map(({ y1, y2 }) => [y1, y2])).toEqual([[4.25, 4.25]]);
    expect(drawn(plot, "dot").map(({ y }) => y)).toEqual([4.25]);
  });

  it("of two factors has a line for each level of the second, in its color", () => {
    const crossed = ["a", "b"].flatMap((character, row) =>
      ["100", "20"].map((speed, column) => mean({ character, speed }, 2 + row + 0.5 * column, 0.25)),
    );
    const plot = marginPlot({ factors: ["character", "speed"], means: crossed }, SCALE, FACTORS);
    const dots = drawn(plot, "dot");
    const ends = dots.filter(({ fill }) => fill === undefined).map(({ y, stroke }) => [y, stroke]);
    expect(ends.slice(0, 4)).toEqual([1.75, 2.75, 2.25, 3.25].map((y) => [y, "100 ms"]));
    expect(ends).toHaveLength(8);
    expect(dots.filter(({ fill }) => fill !== undefined).map(({ x, y, fill }) => [x, y, fill])).toEqual([
      ["Anna", 2, "100 ms"],
      ["Bert", 3, "100 ms"],
      ["Anna", 2.5, "20 ms"],
      ["Bert", 3.5, "20 ms"],
    ]);
    expect(drawn(plot, "rule").map(({ y1, y2, stroke }) => [y1, y2, stroke])[3]).toEqual([3.25, 3.75, "20 ms"]);
    expect(drawn(plot, "line").map(({ z, stroke }) => [z, stroke])).toEqual([
      ["100 ms", "100 ms"],
      ["100 ms", "100 ms"],
      ["20 ms", "20 ms"],
      ["20 ms", "20 ms"],
    ]);
  });
});

describe("levels whose names are colors or symbols", () => {
  it("have the palette's colors and symbols, as the legend says", () => {
    const speed = factor("speed", ["slow", "slow"], ["fast", "fast"]);
    const scalesOf = (second: typeof speed) => {
      const means = second.levels.map(({ name }) => ({
        ...{ levels: { speed: "slow", [second.name]: name }, mean: 2, se_within: 1, low: 1, high: 3, participants: 2, people: [1, 3] },
      }));
      const plot = marginPlot({ factors: ["speed", second.name], means }, SCALE, [speed, second]);
      const marks = (plot.marks ?? []).flat(2) as unknown as DrawnMark[];
      const channels = marks.flatMap((mark) => Object.entries(mark.initialize?.().channels ?? {}));
      return new Set(
        channels.filter(([name]) => ["fill", "stroke", "symbol"].includes(name)).map(([name, { scale }]) => `${name}: ${scale}`),
      );
    };
    const scaled = new Set(["fill: color", "stroke: color", "symbol: symbol"]);
    expect(scalesOf(factor("ink", ["blue", "blue"], ["red", "red"]))).toEqual(scaled);
    expect(scalesOf(factor("shape", ["circle", "circle"], ["square", "square"]))).toEqual(scaled);
  });
});

describe("the chart of answers in each cell", () => {
  it("has the share of each answer, as depth and as a number", () => {
    const cells = [{ cell: "a/20", ratings: 4, counts: [1, 3] }];
    const plot = cellPlot({ bins: [1, 2], cells } as unknown as Parameters<typeof cellPlot>[0], FACTORS);
    const squares = drawn(plot, "cell");
    expect(squares.map(({ x, fillOpacity }) => [x, fillOpacity])).toEqual([
      [1, 0.25],
      [2, 0.75],
    ]);
    expect(drawn(plot, "text").map(({ x, text }) => [x, text])).toEqual([
      [1, "25%"],
      [2, "75%"],
    ]);
  });
});

describe("histograms", () => {
  const results = {
    response_times: [
      { start_ms: 250, answers: 3 },
      { start_ms: 750, answers: 1 },
    ],
    playback: { key_to_first_frame_ms: [0, 4, 2] },
  } as unknown as Parameters<typeof timePlot>[0];

  it("have bins as wide as they count, and as high", () => {
    expect(drawn(timePlot(results), "rect").map(({ x1, x2, y2, y }) => [x1, x2, y2 ?? y])).toEqual([
      [250, 500, 3],
      [750, 1000, 1],
    ]);
    expect(drawn(delayPlot(results), "rect").map(({ x1, x2, y2, y }) => [x1, x2, y2 ?? y])).toEqual([
      [0, 10, 0],
      [10, 20, 4],
      [20, 30, 2],
    ]);
  });
});

describe("the charts of pairs", () => {
  const data = {
    pairs: [{ first: "a/20", second: "b/20", n: 10, first_chosen: 6, second_chosen: 2, ties: 2 }],
    levels: [
      { factor: "character", level: "a", n: 10, share: 0.7 },
      { factor: "character", level: "b", n: 10, share: 0.3 },
    ],
  } as unknown as Parameters<typeof choicePlot>[0];

  it("have the share chosen of each pair in both directions, half of the ties to each", () => {
    const labels = new Map([
      ["a/20", "Anna"],
      ["b/20", "Bert"],
    ]);
    expect(drawn(choicePlot(data, labels), "cell").map(({ x, y, fill }) => [y, x, fill])).toEqual([
      ["Anna", "Bert", 0.7],
      ["Bert", "Anna", 0.30000000000000004],
    ]);
  });

  it("have the share of each level over the others", () => {
    const plot = levelPlot("character", data, FACTORS);
    expect(drawn(plot ?? {}, "dot").map(({ x, y }) => [x, y])).toEqual([
      ["Anna", 0.7],
      ["Bert", 0.3],
    ]);
    expect(drawn(plot ?? {}, "rule").map(({ y }) => y)).toEqual([0.5]);
  });
});

describe("the chart of a threshold", () => {
  it("has the share at each stimulus, the thresholds below and a line at their mean", () => {
    const series = {
      stimuli: [
        { value: 100, second: null, n: 4, positive: 1 },
        { value: 140, second: null, n: 1, positive: 1 },
      ],
      mean: 120,
      thresholds: [110, 130],
    } as unknown as Parameters<typeof seriesPlot>[0];
    const plot = seriesPlot(series, { title: "Speed", second: null }, "yes");
    expect(drawn(plot, "dot").map(({ x, y, r }) => [x, y, r])).toEqual([
      [100, 0.25, 8],
      [140, 1, 5],
    ]);
    expect(drawn(plot, "rule").map(({ x }) => x)).toEqual([120, 110, 130]);
  });
});

describe("the charts of traces", () => {
  const cell = {
    cell: "a",
    people: 2,
    traces: 2,
    left_out: 0,
    times_s: [0, 0.1],
    mean: [50, 60],
    low: [40, 55],
    high: [60, 65],
    level: 55,
    blinks_s: [],
  } as Parameters<typeof cellTracePlot>[0];
  const data = { minimum: 0, maximum: 100, cells: [cell] } as unknown as Parameters<typeof tracesPlot>[0];

  it("have the mean at each moment, and the interval as its band", () => {
    const plot = cellTracePlot(cell, data);
    expect(drawn(plot, "line").map(({ x, y }) => [x, y])).toEqual([
      [0, 50],
      [0.1, 60],
    ]);
    expect(drawn(plot, "area").map(({ y1, y2 }) => [y1, y2])).toEqual([
      [40, 60],
      [55, 65],
    ]);
    expect(drawn(tracesPlot(data, new Map([["a", "Anna"]])), "line").map(({ y, stroke }) => [y, stroke])).toEqual([
      [50, "Anna"],
      [60, "Anna"],
    ]);
  });
});
