/** The figures of continuous ratings. */

import * as Plot from "@observablehq/plot";
import type { Schemas } from "../../api";
import type { Row } from "../../ui/figure-files";
import { PALETTE } from "../../results/plots";

type Data = Schemas["TraceResults"];
type Cell = Schemas["TraceCell"];

interface Point {
  cell: string;
  time_s: number;
  mean: number;
  low: number | undefined;
  high: number | undefined;
}

export function pointsOf(cell: Cell, label: string): Point[] {
  return cell.times_s.map((time_s, sample) => ({
    cell: label,
    time_s,
    mean: cell.mean[sample] ?? NaN,
    low: cell.low?.[sample],
    high: cell.high?.[sample],
  }));
}

const AXES = { height: 240 };
const TIME = { label: "time in the clip (s)", ticks: 6 };

/** All cells' mean traces on one pair of axes. */
export function tracesPlot({ cells, minimum, maximum }: Data, labels: Map<string, string>): Plot.PlotOptions {
  const rows = cells.flatMap((cell) => pointsOf(cell, labels.get(cell.cell) ?? cell.cell));
  return {
    ...AXES,
    caption: "Means over people; the figures of single cells have their 95% CI.",
    x: TIME,
    y: { domain: [minimum, maximum], grid: true, label: "rating" },
    color: { legend: true, domain: [...labels.values()], range: PALETTE },
    // With its scale: Plot would take cells named "blue" and "red" for colors themselves.
    marks: [Plot.lineY(rows, { x: "time_s", y: "mean", stroke: { value: "cell", scale: true }, tip: true })],
  };
}

/** Height of the strip of blinks below the rating, as a share of the scale, and what stays free of a clip's row in it. */
const STRIP = 0.16;
const GAP = 0.3;

/** One tick per blink, and one row per clip below the scale. */
export function ticksOf({ blinks_s }: Cell, { minimum, maximum }: Data): { time_s: number; from: number; to: number }[] {
  const row = (STRIP * (maximum - minimum)) / Math.max(1, blinks_s.length);
  return blinks_s.flatMap((times, lane) =>
    times.map((time_s) => ({ time_s, from: minimum - (lane + 1) * row, to: minimum - (lane + GAP) * row })),
  );
}

/** One cell's mean trace with its interval; below it one row per clip, with a tick at each blink. */
export function cellTracePlot(cell: Cell, data: Data): Plot.PlotOptions {
  const { minimum, maximum } = data;
  const [rows, ticks] = [pointsOf(cell, ""), ticksOf(cell, data)];
  const foot = ticks.length > 0 ? minimum - STRIP * (maximum - minimum) : minimum;
  return {
    ...AXES,
    caption: `N = ${String(cell.people)}. Line: mean. ${cell.low === null ? "One person: no interval." : "Band: 95% CI over people."}`,
    x: TIME,
    y: { domain: [foot, maximum], ticks: [minimum, (minimum + maximum) / 2, maximum], grid: true, label: "rating" },
    marks: [
      ...(cell.low ? [Plot.areaY(rows, { x: "time_s", y1: "low", y2: "high", fill: "currentColor", fillOpacity: 0.18 })] : []),
      Plot.ruleX(ticks, { x: "time_s", y1: "from", y2: "to", strokeWidth: 1.5 }),
      Plot.lineY(rows, { x: "time_s", y: "mean", stroke: "currentColor", tip: true }),
    ],
  };
}

/** The numbers of the figure, as they are saved. */
export function traceRows(cells: readonly Cell[], labels: ReadonlyMap<string, string>): Row[] {
  return cells.flatMap((cell) => pointsOf(cell, labels.get(cell.cell) ?? cell.cell).map((point) => ({ ...point })));
}
