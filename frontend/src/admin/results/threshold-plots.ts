/** The figure of an adaptive series. */

import * as Plot from "@observablehq/plot";
import type { Schemas } from "../api";
import { type Factors, labelsOf } from "./plots";

type Series = Schemas["SeriesResult"];

/** A series in words: the labels of its levels, or its name; both where two series have the same levels. */
export function seriesLabels(every: Series[], factors: Factors): Map<string, string> {
  const told = every.map(({ name, levels }) => {
    const words = Object.entries(levels).map(([factor, level]) => labelsOf(factors, factor).of(level));
    return { name, words: words.join(", ") };
  });
  const times = (words: string) => told.filter((one) => one.words === words).length;
  return new Map(
    told.map(({ name, words }) => {
      if (words === "") return [name, name];
      return [name, times(words) > 1 ? `${words} (${name})` : words];
    }),
  );
}

/** Share of positive answers at each stimulus, larger where there are more; people's thresholds as ticks below. */
export function seriesPlot(series: Series, along: string, positive: string): Plot.PlotOptions {
  const rows = series.stimuli.map(({ value, n, positive: yes }) => ({ value, share: yes / n, n }));
  const most = Math.max(1, ...rows.map(({ n }) => n));
  const radius = ({ n }: { n: number }) => 2 + 6 * Math.sqrt(n / most);
  return {
    height: 230,
    marginLeft: 48,
    marginBottom: 40,
    x: { label: along, nice: true, ticks: 6 },
    y: { domain: [-0.06, 1], ticks: [0, 0.25, 0.5, 0.75, 1], tickFormat: ".0%", grid: true, label: positive },
    marks: [
      ...(series.mean === null ? [] : [Plot.ruleX([series.mean], { strokeDasharray: "4 3" })]),
      Plot.ruleX(series.thresholds, { x: (threshold: number) => threshold, y1: () => -0.06, y2: () => -0.01, strokeOpacity: 0.5 }),
      Plot.dot(rows, { x: "value", y: "share", r: radius, fill: "currentColor", fillOpacity: 0.7, tip: true, channels: { answers: "n" } }),
    ],
  };
}
