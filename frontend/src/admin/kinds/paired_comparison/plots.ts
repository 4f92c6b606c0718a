/** Figures of paired comparisons. */

import * as Plot from "@observablehq/plot";
import type { Schemas } from "../../api";
import { cellLabels, type Factors, labelAxis, labelsOf, leftOf } from "../../results/plots";

type Data = Schemas["PairResults"];

/** The cells that were compared, with their labels. */
export function comparedCells({ pairs }: Data, factors: Factors): Map<string, string> {
  return cellLabels(
    pairs.flatMap(({ first, second }) => [first, second]),
    factors,
  );
}

/** One row and column per cell, columns by the numbers of the rows: how often that of the row was chosen over that of the column. */
export function choicePlot({ pairs }: Data, labels: Map<string, string>): Plot.PlotOptions {
  const names = [...labels.values()];
  const numbers = new Map(names.map((name, index) => [name, String(index + 1)]));
  const rows = pairs.flatMap(({ first, second, n, first_chosen, ties }) => {
    const share = (first_chosen + ties / 2) / n;
    const [one, other] = [labels.get(first) ?? first, labels.get(second) ?? second];
    return [
      { chosen: one, over: other, share, n },
      { chosen: other, over: one, share: 1 - share, n },
    ];
  });
  return {
    height: 80 + 44 * names.length,
    marginLeft: leftOf(names),
    x: { domain: names, label: "over", tickFormat: (name: string) => numbers.get(name) ?? "" },
    y: { domain: names, label: null },
    color: { type: "linear", scheme: "PuOr", domain: [0, 1], legend: true, label: "share chosen", tickFormat: ".0%" },
    marks: [
      labelAxis((name) => `${numbers.get(name) ?? ""} ${name}`),
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
  const counts = rows.map(({ n }) => n);
  const comparisons = [...new Set([Math.min(...counts), Math.max(...counts)])].join(" to ");
  return {
    height: 230,
    caption: `Share of comparisons with another level in which it was chosen, N = ${comparisons} per level, ties as half. Dashed: no preference. The report has the intervals.`,
    marginBottom: 68,
    // Room for "100%" next to the title of the axis.
    marginLeft: 48,
    x: { domain: labels.all, label: null },
    y: { domain: [0, 1], tickFormat: ".0%", grid: true, label: "share chosen" },
    marks: [
      Plot.axisX({ lineWidth: 24 / Math.max(3, labels.all.length), label: labels.title, labelAnchor: "center", labelArrow: "none" }),
      Plot.ruleY([0.5], { strokeDasharray: "4 3", strokeOpacity: 0.6 }),
      Plot.dot(rows, { x: "level", y: "share", r: 4, fill: "currentColor", tip: true, channels: { comparisons: "n" } }),
    ],
  };
}
