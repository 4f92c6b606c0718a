/** The figures of the results, and the numbers of each as they are saved: labels where the figures have labels. */

import * as Plot from "@observablehq/plot";
import type { Schemas } from "../api";
import type { Row } from "../ui/figure-files";
import { useMemo } from "react";

// The figures of the results page.

type Results = Schemas["Results"];
export type AnyResults = Results | Schemas["PairResults"] | Schemas["ThresholdResults"] | Schemas["TraceResults"] | Schemas["OtherResults"];
export type Factors = Schemas["DesignOut"]["factors"];

/** What the results of a kind are given. */
export interface ShownResults {
  study: string;
  data: AnyResults;
  factors: Factors;
}

/** The label of a level, and the labels of a factor in declared order. */
export function labelsOf(factors: Factors, name: string): { title: string; of: (level: string) => string; all: string[] } {
  const factor = factors.find((one) => one.name === name);
  const labels = new Map(factor?.levels.map((level) => [level.name, level.label]) ?? []);
  return { title: factor?.label ?? name, of: (level) => labels.get(level) ?? level, all: [...labels.values()] };
}

/** Cells in declared order with the labels of the factors in which they differ. */
export function cellLabels(cells: Iterable<string>, factors: Factors): Map<string, string> {
  const every = [...new Set(cells)].sort((one, other) => order(one, factors) - order(other, factors));
  const varied = factors.map((_, index) => new Set(every.map((cell) => cell.split("/")[index])).size > 1);
  return new Map(every.map((cell) => [cell, labelOf(cell, factors, varied)]));
}

/** The place of a cell among all, the last factor fastest. */
function order(cell: string, factors: Factors): number {
  const levels = cell.split("/");
  return factors.reduce(
    (sum, factor, index) => sum * factor.levels.length + factor.levels.findIndex(({ name }) => name === levels[index]),
    0,
  );
}

function labelOf(cell: string, factors: Factors, varied: boolean[]): string {
  const labels = cell.split("/").map((level, index) => labelsOf(factors, factors[index]?.name ?? "").of(level));
  return labels.filter((_, index) => varied[index]).join(", ") || cell;
}

/** Room and line width for labels on the left: they break into lines, so that a phone's width holds the figure too. */
const LABEL_EMS = 9;
const PX_PER_EM = 12;

export function leftOf(labels: string[]): number {
  const longest = Math.max(3, ...labels.map((label) => label.length));
  return 24 + PX_PER_EM * Math.min(LABEL_EMS, 0.6 * longest);
}

export function labelAxis(text: (name: string) => string): Plot.Markish {
  return Plot.axisY({ lineWidth: LABEL_EMS, label: null, tickFormat: text });
}

/** Width of labels below a figure, in ems, and the room of their lines. */
const belowEms = (labels: readonly string[]) => 24 / Math.max(3, labels.length);

function belowOf(labels: readonly string[]): number {
  const lines = Math.max(1, ...labels.map((label) => Math.ceil((0.6 * label.length) / belowEms(labels))));
  return 24 + 14 * (lines === 1 ? 1 : lines + 1);
}

/** Means of one factor, or of two: the second as color. Bars are within-participant standard errors. */
export function marginPlot(margin: Schemas["Margin"], { scale }: Results, factors: Factors): Plot.PlotOptions {
  const [first = "", second] = margin.factors;
  const [across, hues] = [labelsOf(factors, first), labelsOf(factors, second ?? "")];
  const rows = margin.means.map((mean) => ({
    x: across.of(mean.levels[first] ?? ""),
    colour: second === undefined ? "" : hues.of(mean.levels[second] ?? ""),
    mean: mean.mean,
    low: mean.mean - (mean.se_within ?? 0),
    high: mean.mean + (mean.se_within ?? 0),
  }));
  const crossed = second !== undefined;
  const colour = crossed ? "colour" : "currentColor";
  return {
    height: 250,
    marginBottom: belowOf(across.all),
    caption: rows.some(({ low, high }) => low < high)
      ? "Bars: ± one within-participant standard error."
      : "No bars: a standard error needs at least two participants with different answers.",
    x: { type: "point", padding: 0.6, label: null, domain: across.all.length > 0 ? across.all : rows.map((row) => row.x) },
    y: { domain: [scale.minimum, scale.maximum], grid: true, label: `mean ${scale.name}` },
    color: { legend: crossed, scheme: "observable10", ...(crossed ? { domain: hues.all } : {}) },
    marks: [
      // Long labels break into lines.
      Plot.axisX({ lineWidth: belowEms(across.all), label: null }),
      ...(crossed ? [Plot.line(rows, { x: "x", y: "mean", stroke: "colour", z: "colour", strokeOpacity: 0.5 })] : []),
      Plot.ruleX(rows, { x: "x", y1: "low", y2: "high", stroke: colour, strokeWidth: 1.5 }),
      Plot.dot(rows, { x: "x", y: "mean", fill: colour, r: 3, tip: true }),
    ],
  };
}

const SHARE_COLOUR = "#3c8697";

/** Bins that can all be named below a narrow figure, as the points of a scale are. */
const MAX_TICKS = 11;

const shareOf = ({ share }: { share: number }) => (share >= 0.005 ? `${Math.round(100 * share)}%` : "");

/** One row a cell, one column an answer: the share of answers as depth of color, and as a number. */
export function cellPlot({ cells, bins }: Results, factors: Factors): Plot.PlotOptions {
  const labels = cellLabels(
    cells.map(({ cell }) => cell),
    factors,
  );
  const names = [...labels.values()];
  const rows = cells.flatMap((cell) =>
    cell.counts.map((count, bin) => ({
      cell: labels.get(cell.cell) ?? cell.cell,
      response: bins[bin] ?? 0,
      share: cell.ratings === 0 ? 0 : count / cell.ratings,
    })),
  );
  const deepest = Math.max(0.01, ...rows.map((row) => row.share));
  const every = Math.ceil(bins.length / MAX_TICKS);
  const step = (bins[1] ?? 1) - (bins[0] ?? 0);
  return {
    height: Math.max(140, 34 * cells.length + 50),
    marginLeft: leftOf(names),
    marginBottom: 36,
    x: { label: every === 1 ? "answer" : `answer, from the number on, ${step} wide`, ticks: bins.filter((_, bin) => bin % every === 0) },
    y: { label: null, domain: names },
    marks: [
      labelAxis((name) => name),
      Plot.cell(rows, {
        x: "response",
        y: "cell",
        fill: SHARE_COLOUR,
        fillOpacity: (row: { share: number }) => (0.75 * row.share) / deepest,
        inset: 0.5,
        ...(every === 1 ? {} : { title: shareOf }),
      }),
      // Columns of many bins are narrower than a share's words, which are in their titles.
      Plot.text(every === 1 ? rows : [], { x: "response", y: "cell", text: shareOf, fill: "currentColor", fontSize: 11 }),
    ],
  };
}

const MAX_COUNT_TICKS = 6;

/** Ticks at whole numbers: there is no half answer. */
export function countTicks(largest: number): number[] {
  let [ten, digit] = [1, 1];
  while (largest > MAX_COUNT_TICKS * ten * digit) {
    if (digit === 5) [ten, digit] = [10 * ten, 1];
    else digit = digit === 1 ? 2 : 5;
  }
  const step = ten * digit;
  return Array.from({ length: Math.floor(largest / step) + 1 }, (_, index) => index * step);
}

/** A histogram of bins `step` wide that start at `from`. */
function histogram(bins: { from: number; count: number }[], step: number, label: string, counted: string): Plot.PlotOptions {
  return {
    height: 210,
    marginLeft: 52,
    marginBottom: 36,
    x: { label },
    y: { label: counted, grid: true, ticks: countTicks(Math.max(1, ...bins.map(({ count }) => count))), tickFormat: "d" },
    marks: [
      Plot.rectY(bins, { x1: "from", x2: ({ from }: { from: number }) => from + step, y: "count", fill: SHARE_COLOUR, tip: true }),
      Plot.ruleY([0]),
    ],
  };
}

export function timePlot({ response_times }: AnyResults): Plot.PlotOptions {
  const bins = response_times.map(({ start_ms, answers }) => ({ from: start_ms, count: answers }));
  return histogram(
    bins.filter(({ from }) => from <= 10_000),
    250,
    "ms",
    "answers",
  );
}

export function delayPlot({ playback }: AnyResults): Plot.PlotOptions {
  const bins = playback.key_to_first_frame_ms.map((count, bin) => ({ from: 10 * bin, count }));
  return histogram(bins, 10, "ms, key to frame (last bin: 100+)", "plays");
}

// The numbers of each figure of the results, as they are saved: labels where the figures have labels.

type Labels = ReadonlyMap<string, string>;

export function marginRows(margin: Schemas["Margin"], factors: Factors): Row[] {
  const named = margin.factors.map((name) => ({ name, ...labelsOf(factors, name) }));
  /** The place of a mean in declared order, the last factor fastest. */
  const rank = (levels: Record<string, string>) =>
    named.reduce((sum, { name, of, all }) => sum * (all.length + 1) + all.indexOf(of(levels[name] ?? "")), 0);
  return margin.means
    .toSorted((a, b) => rank(a.levels) - rank(b.levels))
    .map(({ levels, ...numbers }) => ({
      ...Object.fromEntries(named.map(({ name, title, of }) => [title, of(levels[name] ?? "")])),
      ...numbers,
    }));
}

export function cellRows({ cells, bins }: Schemas["Results"], labels: Labels): Row[] {
  const rank = new Map([...labels.keys()].map((cell, index) => [cell, index]));
  const inOrder = cells.toSorted((a, b) => (rank.get(a.cell) ?? 0) - (rank.get(b.cell) ?? 0));
  return inOrder.map(({ cell, ratings, counts }) => ({
    cell: labels.get(cell) ?? cell,
    ratings,
    ...Object.fromEntries(counts.map((count, bin) => [`answer ${bins[bin] ?? ""}`, count])),
  }));
}

export function timeRows({ response_times }: AnyResults): Row[] {
  return response_times.map(({ start_ms, answers }) => ({ from_ms: start_ms, answers }));
}

export function delayRows({ playback }: AnyResults): Row[] {
  return playback.key_to_first_frame_ms.map((plays, bin) => ({ from_ms: 10 * bin, plays }));
}

export function choiceRows({ pairs }: Schemas["PairResults"], labels: Labels): Row[] {
  return pairs.map(({ first, second, ...counts }) => ({
    first: labels.get(first) ?? first,
    second: labels.get(second) ?? second,
    ...counts,
  }));
}

export function levelRows(name: string, { levels }: Schemas["PairResults"], factors: Factors): Row[] {
  const { title, of } = labelsOf(factors, name);
  return levels.filter(({ factor }) => factor === name).map(({ level, n, share }) => ({ [title]: of(level), comparisons: n, share }));
}

export function seriesRows({ stimuli }: Schemas["SeriesResult"], along: string, second: string | undefined): Row[] {
  return stimuli.map((stimulus) => ({
    [along]: stimulus.value,
    ...(second === undefined ? {} : { [second]: stimulus.second }),
    answers: stimulus.n,
    positive: stimulus.positive,
  }));
}

/** The labels of the cells of these rows. */
export function useCellLabels(rows: readonly { cell: string }[], factors: Factors): Map<string, string> {
  return useMemo(
    () =>
      cellLabels(
        rows.map(({ cell }) => cell),
        factors,
      ),
    [rows, factors],
  );
}
