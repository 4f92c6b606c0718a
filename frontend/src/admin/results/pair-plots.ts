/** Figures of paired comparisons. */

import * as Plot from "@observablehq/plot";
import type { Schemas } from "../api";
import { type Factors, labelsOf } from "./plots";

type Data = Schemas["PairResults"];

/** The cells that were compared, in declared order, with the labels of the factors in which they differ. */
export function cellLabels({ pairs }: Data, factors: Factors): Map<string, string> {
  const met = new Set(pairs.flatMap(({ first, second }) => [first, second]));
  const cells = [...met].sort((one, other) => order(one, factors) - order(other, factors));
  const varied = factors.map((_, place) => new Set(cells.map((cell) => cell.split("/")[place])).size > 1);
  return new Map(cells.map((cell) => [cell, labelOf(cell, factors, varied)]));
}

/** The place of a cell among all, the last factor fastest. */
function order(cell: string, factors: Factors): number {
  const levels = cell.split("/");
  return factors.reduce(
    (sum, factor, place) => sum * factor.levels.length + factor.levels.findIndex(({ name }) => name === levels[place]),
    0,
  );
}

function labelOf(cell: string, factors: Factors, varied: boolean[]): string {
  const labels = cell.split("/").map((level, place) => labelsOf(factors, factors[place]?.name ?? "").of(level));
  return labels.filter((_, place) => varied[place]).join(", ") || cell;
}

const LONGEST = 24;
const short = (label: string) => (label.length > LONGEST ? `${label.slice(0, LONGEST - 1)}…` : label);

/** One row and column a cell: how often that of the row was chosen over that of the column. */
export function choicePlot({ pairs }: Data, labels: Map<string, string>): Plot.PlotOptions {
  const names = [...labels.values()];
  const rows = pairs.flatMap(({ first, second, n, first_chosen, ties }) => {
    const share = (first_chosen + ties / 2) / n;
    const [one, other] = [labels.get(first) ?? first, labels.get(second) ?? second];
    return [
      { chosen: one, over: other, share, n },
      { chosen: other, over: one, share: 1 - share, n },
    ];
  });
  return {
    height: 110 + 34 * names.length,
    marginLeft: 12 + 7 * Math.min(LONGEST, Math.max(4, ...names.map((name) => name.length))),
    marginBottom: 100,
    x: { domain: names, label: "over", tickRotate: -30, tickFormat: short },
    y: { domain: names, label: null, tickFormat: short },
    color: { type: "linear", scheme: "PuOr", domain: [0, 1], legend: true, label: "share chosen", tickFormat: ".0%" },
    marks: [
      Plot.cell(rows, { x: "over", y: "chosen", fill: "share", inset: 0.5, tip: true, channels: { comparisons: "n" } }),
      Plot.text(rows, {
        x: "over",
        y: "chosen",
        text: (row: { share: number }) => `${Math.round(100 * row.share)}%`,
        fill: (row: { share: number }) => (Math.abs(row.share - 0.5) > 0.35 ? "white" : "black"),
        fontSize: 11,
      }),
    ],
  };
}

/** How often each level was chosen over the other levels of its factor; null where they never met. */
export function levelPlot(name: string, { levels }: Data, factors: Factors): Plot.PlotOptions | null {
  const labels = labelsOf(factors, name);
  const rows = levels
    .filter((level) => level.factor === name && level.share !== null)
    .map(({ level, n, share }) => ({ level: labels.of(level), share: share ?? 0, n }));
  if (rows.length === 0) return null;
  return {
    height: 210,
    marginBottom: 52,
    x: { domain: labels.all, label: null },
    y: { domain: [0, 1], tickFormat: ".0%", grid: true, label: "chosen over other levels" },
    marks: [
      Plot.axisX({ lineWidth: 24 / Math.max(3, labels.all.length), label: null }),
      Plot.ruleY([0.5], { strokeDasharray: "4 3", strokeOpacity: 0.6 }),
      Plot.dot(rows, { x: "level", y: "share", r: 4, fill: "currentColor", tip: true, channels: { comparisons: "n" } }),
    ],
  };
}
