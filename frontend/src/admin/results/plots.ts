/** The figures of the results page. */

import * as Plot from "@observablehq/plot";
import type { Schemas } from "../api";

type Results = Schemas["Results"];

/** Means of one factor, or of two: the second as colour. Bars are within-participant standard errors. */
export function marginPlot(margin: Schemas["Margin"], { scale_minimum, scale_maximum }: Results): Plot.PlotOptions {
  const [first = "", second] = margin.factors;
  const rows = margin.means.map((mean) => ({
    x: mean.levels[first] ?? "",
    colour: second === undefined ? "" : (mean.levels[second] ?? ""),
    mean: mean.mean,
    low: mean.mean - (mean.se_within ?? 0),
    high: mean.mean + (mean.se_within ?? 0),
  }));
  const colour = second === undefined ? "currentColor" : "colour";
  const crossed = second !== undefined;
  return {
    height: 240,
    marginBottom: 36,
    x: { type: "point", padding: 0.6, label: null, domain: [...new Set(rows.map((row) => row.x))] },
    y: { domain: [scale_minimum, scale_maximum], grid: true, label: "mean rating" },
    color: { legend: crossed, scheme: "observable10" },
    marks: [
      ...(crossed ? [Plot.line(rows, { x: "x", y: "mean", stroke: "colour", z: "colour", strokeOpacity: 0.5 })] : []),
      Plot.ruleX(rows, { x: "x", y1: "low", y2: "high", stroke: colour, strokeWidth: 1.5 }),
      Plot.dot(rows, { x: "x", y: "mean", fill: colour, r: 4, tip: true }),
    ],
  };
}

export function cellPlot({ cells, scale_minimum }: Results): Plot.PlotOptions {
  const rows = cells.flatMap((cell) =>
    cell.counts.map((count, place) => ({
      cell: cell.cell,
      response: place + scale_minimum,
      share: cell.ratings === 0 ? 0 : count / cell.ratings,
    })),
  );
  return {
    height: Math.max(160, 18 * cells.length + 60),
    marginLeft: 190,
    x: { label: "answer" },
    y: { label: null },
    color: { scheme: "blues", label: "share", legend: true },
    marks: [Plot.cell(rows, { x: "response", y: "cell", fill: "share", inset: 0.5, tip: true })],
  };
}

export function timePlot({ response_times }: Results): Plot.PlotOptions {
  const rows = response_times.filter(({ start_ms }) => start_ms <= 10_000);
  return {
    height: 200,
    x: { label: "ms" },
    y: { label: "answers", grid: true },
    marks: [
      Plot.rectY(rows, {
        x1: "start_ms",
        x2: ({ start_ms }: Schemas["TimeBin"]) => start_ms + 250,
        y: "answers",
        fill: "currentColor",
        fillOpacity: 0.6,
      }),
      Plot.ruleY([0]),
    ],
  };
}

export function delayPlot({ playback }: Results): Plot.PlotOptions {
  return {
    height: 160,
    x: { label: "from key to first frame (ms; last bin: 100 and more)" },
    y: { label: "plays", grid: true },
    marks: [
      Plot.rectY(playback.key_to_first_frame_ms, {
        x1: (_, place: number) => 10 * place,
        x2: (_, place: number) => 10 * place + 10,
        y: (count: number) => count,
        fill: "currentColor",
        fillOpacity: 0.6,
      }),
      Plot.ruleY([0]),
    ],
  };
}
