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

/** The title of an axis is in its middle, without an arrow. */
const CENTERED = { labelAnchor: "center", labelArrow: "none" } as const;
const TITLE_PX = 6;

const BLUE = "#0072B2";
/** Okabe and Ito's colors in the report's order, which people with any common color vision can tell apart; so do symbols. */
export const PALETTE = [BLUE, "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6A00", "#888888"];
const SYMBOLS: Plot.SymbolType[] = ["circle", "square", "triangle", "diamond", "wye", "cross", "star", "times"];

/** Width of labels below a figure, in ems, and the room of their lines. */
const belowEms = (labels: readonly string[]) => 24 / Math.max(3, labels.length);

function belowOf(labels: readonly string[]): number {
  const lines = Math.max(1, ...labels.map((label) => Math.ceil((0.6 * label.length) / belowEms(labels))));
  return 24 + 14 * (lines === 1 ? 1 : lines + 1);
}

/** Where participants lie around their mean: in so many columns, so that equal answers do not hide each other. */
const JITTER = [0, -2, 2, -1, 1];
/** Room of all conditions of a figure on a phone. */
const CONDITIONS_PX = 240;

/** The end of an error bar: wider than the point of a mean, which hides a bar that is shorter than itself. */
const CAP = {
  draw(context: CanvasPath) {
    context.moveTo(-7, 0);
    context.lineTo(7, 0);
  },
};

/** The palette's color of a level. Plot would take levels named "blue" and "red", or "circle", for colors and symbols themselves. */
const SHADE = { value: "colour", scale: true } as const;

/** Means of one factor, or of two: the second as color and symbol; behind them participants. The report draws the same. */
export function marginPlot(margin: Schemas["Margin"], { scale }: Results, factors: Factors): Plot.PlotOptions {
  const [first = "", second] = margin.factors;
  const [across, hues] = [labelsOf(factors, first), labelsOf(factors, second ?? "")];
  const rows = margin.means.map(({ levels, mean, low, high, people }) => ({
    x: across.of(levels[first] ?? ""),
    colour: second === undefined ? "" : hues.of(levels[second] ?? ""),
    mean,
    // The axis is the scale: intervals of few people that reach beyond it are cut, and the caption says so.
    low: Math.max(low ?? mean, scale.minimum),
    high: Math.min(high ?? mean, scale.maximum),
    people,
  }));
  const crossed = second !== undefined;
  const shades = crossed ? hues.all : [""];
  const domain = across.all.length > 0 ? across.all : rows.map((row) => row.x);
  const step = Math.min(22, CONDITIONS_PX / Math.max(1, domain.length * shades.length));
  const marks = shades.map((shade, row) => {
    const own = rows.filter(({ colour }) => colour === shade);
    const bars = own.filter(({ low, high }) => low < high);
    const dx = (row - (shades.length - 1) / 2) * step;
    const ink = crossed ? { stroke: SHADE } : { stroke: BLUE };
    const fill = crossed ? { fill: SHADE, symbol: SHADE } : { fill: BLUE };
    const points = own.flatMap((row) => row.people.map((mean, index) => ({ ...row, mean, column: index % JITTER.length })));
    const columns = JITTER.map((to, column) => ({ dx: dx + (to * step) / 8, points: points.filter((point) => point.column === column) }));
    return [
      ...columns.map((column) =>
        Plot.dot(column.points, { x: "x", y: "mean", dx: column.dx, r: 2, fill: crossed ? SHADE : BLUE, fillOpacity: 0.45 }),
      ),
      ...(crossed ? [Plot.line(own, { x: "x", y: "mean", z: "colour", dx, ...ink, strokeOpacity: 0.6 })] : []),
      Plot.ruleX(own, { x: "x", y1: "low", y2: "high", dx, ...ink, strokeWidth: 1.5 }),
      ...["low", "high"].map((end) => Plot.dot(bars, { x: "x", y: end, dx, ...ink, symbol: CAP, strokeWidth: 1.5 })),
      Plot.dot(own, { x: "x", y: "mean", dx, ...fill, r: 4, stroke: "white", strokeWidth: 0.7, tip: true }),
    ];
  });
  return {
    height: 280,
    marginBottom: belowOf(domain) + TITLE_PX,
    caption: marginCaption(margin, scale),
    x: { type: "point", padding: 0.6, label: null, domain },
    y: { domain: [scale.minimum, scale.maximum], grid: true, label: `mean ${scale.name}` },
    color: crossed ? { domain: hues.all, range: PALETTE } : {},
    symbol: crossed ? { domain: hues.all, range: SYMBOLS, legend: true } : {},
    // Long labels break into lines.
    marks: [Plot.axisX({ lineWidth: belowEms(domain), label: across.title, ...CENTERED }), ...marks.flat()],
  };
}

/** What points and bars are, and of how many people. */
function marginCaption({ means }: Schemas["Margin"], { minimum, maximum }: Results["scale"]): string {
  const numbers = [...new Set(means.map(({ participants }) => participants))].sort((a, b) => a - b);
  const people = numbers.length > 1 ? `${String(numbers[0])} to ${String(numbers.at(-1))}` : String(numbers[0] ?? 0);
  const shown = Math.max(0, ...means.map((mean) => mean.people.length));
  const some = shown < (numbers.at(-1) ?? 0) ? ` (${String(shown)} shown)` : "";
  const known = means.flatMap(({ low, high }) => (low === null || high === null ? [] : [high - low]));
  const bars = known.some((length) => length > 0)
    ? "Bars: 95% within-participant CI (Cousineau-Morey)."
    : known.length > 0
      ? "No bars: the intervals have no length, since all participants differ by the same amount between conditions."
      : "No bars: an interval needs at least two participants.";
  const isCut = means.some(({ low, high }) => (low ?? minimum) < minimum || (high ?? maximum) > maximum);
  const cut = isCut ? " Bars are cut at the ends of the scale; the CSV has the whole intervals." : "";
  return `N = ${people}. Small points: participants${some}. Large points: their means. ${bars}${cut}`;
}

const SHARE_COLOUR = "#3c8697";

/** Bins that can all be named below a narrow figure, as the points of a scale are. */
const MAX_TICKS = 11;

const shareOf = ({ share }: { share: number }) => (share >= 0.005 ? `${Math.round(100 * share)}%` : "");

/** One row per cell, one column per answer: the share of answers as depth of color, and as a number. */
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
    caption: "Share of the answers in each cell; deeper color: more answers.",
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

/** A histogram of bins `step` wide that start at `from`; `note` follows N in its caption. */
function histogram(bins: { from: number; count: number }[], step: number, label: string, counted: string, note = ""): Plot.PlotOptions {
  return {
    height: 210,
    caption: `N = ${String(bins.reduce((sum, { count }) => sum + count, 0))} ${counted}.${note}`,
    x: { label, domain: [0, Math.max(step, ...bins.map(({ from }) => from + step))] },
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
    "response time after the clip (ms)",
    "answers",
  );
}

export function delayPlot({ playback }: AnyResults): Plot.PlotOptions {
  const bins = playback.key_to_first_frame_ms.map((count, bin) => ({ from: 10 * bin, count }));
  return histogram(bins, 10, "time from key to first frame (ms)", "plays", " The last bar holds all of 100 ms and more.");
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
    .map(({ levels, mean, se_within, low, high, participants }) => ({
      ...Object.fromEntries(named.map(({ name, title, of }) => [title, of(levels[name] ?? "")])),
      ...{ mean, se_within, ci95_low: low, ci95_high: high, participants },
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
