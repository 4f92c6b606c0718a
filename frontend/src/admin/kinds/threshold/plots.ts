/** The figure of an adaptive series. */

import * as Plot from "@observablehq/plot";
import type { Schemas } from "../../api";
import { type Factors, labelsOf } from "../../results/plots";

type Series = Schemas["SeriesResult"];

/** A series in words: the labels of its levels, or its name; both where two series have the same levels. */
export function seriesLabels(every: Series[], factors: Factors): Map<string, string> {
  const named = every.map(({ name, levels }) => {
    const words = Object.entries(levels).map(([factor, level]) => labelsOf(factors, factor).of(level));
    return { name, words: words.join(", ") };
  });
  const times = (words: string) => named.filter((one) => one.words === words).length;
  return new Map(
    named.map(({ name, words }) => {
      if (words === "") return [name, name];
      return [name, times(words) > 1 ? `${words} (${name})` : words];
    }),
  );
}

/** What a series moves along: titles of the factor and, where there are two, of the second with its middle. */
export interface Along {
  title: string;
  second: { title: string; middle: number } | null;
}

function rowsOf(series: Series) {
  const rows = series.stimuli.map(({ value, second, n, positive }) => ({ value, second, share: positive / n, n }));
  const largest = Math.max(1, ...rows.map(({ n }) => n));
  return { rows, radius: ({ n }: { n: number }) => 2 + 6 * Math.sqrt(n / largest) };
}

/** The figure of a series: over one factor or over two. */
export function seriesPlot(series: Series, along: Along, positive: string): Plot.PlotOptions {
  return along.second ? planePlot(series, along.title, along.second, positive) : linePlot(series, along.title, positive);
}

/** Every stimulus by its two numbers, darker the more positive answers, larger where there are more; the mean threshold on its line. */
function planePlot(series: Series, along: string, second: { title: string; middle: number }, positive: string): Plot.PlotOptions {
  const { rows, radius } = rowsOf(series);
  const mean = series.mean === null ? [] : [{ value: series.mean, second: second.middle }];
  return {
    height: 260,
    x: { label: along, nice: true, ticks: 6 },
    y: { label: second.title, nice: true, inset: 14, ticks: [...new Set(rows.map((row) => row.second ?? 0))] },
    color: { type: "linear", scheme: "viridis", domain: [0, 1], tickFormat: ".0%", label: positive, legend: true },
    marks: [
      Plot.dot(rows, { x: "value", y: "second", r: radius, fill: "share", tip: true, channels: { answers: "n" } }),
      Plot.dot(mean, { x: "value", y: "second", symbol: "times", r: 7, strokeWidth: 2, stroke: "currentColor" }),
    ],
  };
}

/** Share of positive answers at each stimulus, larger where there are more; people's thresholds as ticks below. */
function linePlot(series: Series, along: string, positive: string): Plot.PlotOptions {
  const { rows, radius } = rowsOf(series);
  return {
    height: 230,
    x: { label: along, nice: true, ticks: 6 },
    y: { domain: [-0.06, 1], ticks: [0, 0.25, 0.5, 0.75, 1], tickFormat: ".0%", grid: true, label: positive },
    marks: [
      ...(series.mean === null ? [] : [Plot.ruleX([series.mean], { strokeDasharray: "4 3" })]),
      Plot.ruleX(series.thresholds, { x: (threshold: number) => threshold, y1: () => -0.06, y2: () => -0.01, strokeOpacity: 0.5 }),
      Plot.dot(rows, { x: "value", y: "share", r: radius, fill: "currentColor", fillOpacity: 0.7, tip: true, channels: { answers: "n" } }),
    ],
  };
}
