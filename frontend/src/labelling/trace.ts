/** A distance over time, and its line in a window of a figure. */

import { requiredColumn, type Table } from "./csv";

/** Values of one column, NaN where a cell is empty or no number. */
export function traceOf(table: Table, column: string): Float64Array {
  const index = requiredColumn(table, column);
  return Float64Array.from(table.rows, (row) => {
    const text = row[index] ?? "";
    return text === "" ? Number.NaN : Number(text);
  });
}

/** Least and greatest value with a little room; 0 to 1 for a trace without values. */
export function extent(values: Float64Array): [low: number, high: number] {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!(high >= low)) return [0, 1];
  const room = (high - low) * 0.05 || 1;
  return [low - room, high + room];
}

export interface Window {
  /** First and last frame shown; need not be whole. */
  readonly from: number;
  readonly to: number;
}

/** The window about `centre` that is `factor` times as long, held inside 0 to `last`, 10 frames at least. */
export function zoomedWindow({ from, to }: Window, factor: number, centre: number, last: number): Window {
  const length = Math.min(last, Math.max(10, (to - from) * factor));
  const share = to > from ? (centre - from) / (to - from) : 0.5;
  return movedWindow({ from: centre - share * length, to: centre - share * length + length }, 0, last);
}

/** The window moved by `frames`, held inside 0 to `last`. */
export function movedWindow({ from, to }: Window, frames: number, last: number): Window {
  const start = Math.max(0, Math.min(last - (to - from), from + frames));
  return { from: start, to: start + (to - from) };
}

/**
 * Path of a trace inside a window: every sample, or the least and greatest of each pixel where samples are denser.
 * Missing samples break the line.
 */
export function tracePath(
  values: Float64Array,
  window: Window,
  width: number,
  height: number,
  [low, high]: readonly [number, number],
): string {
  const first = Math.max(0, Math.floor(window.from));
  const last = Math.min(values.length - 1, Math.ceil(window.to));
  const scale = width / (window.to - window.from);
  const y = (value: number): string => (height - ((value - low) / (high - low)) * height).toFixed(1);
  const stride = Math.max(1, Math.floor(1 / scale));
  let path = "";
  let pen = "M";
  for (let frame = first; frame <= last; frame += stride) {
    const ends = extremes(values, frame, Math.min(last + 1, frame + stride));
    if (ends === null) {
      pen = "M";
      continue;
    }
    const x = ((frame - window.from) * scale).toFixed(1);
    path += `${pen}${x} ${y(ends[0])}`;
    if (ends[1] !== ends[0]) path += `L${x} ${y(ends[1])}`;
    pen = "L";
  }
  return path;
}

function extremes(values: Float64Array, start: number, stop: number): [number, number] | null {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (let frame = start; frame < stop; frame += 1) {
    const value = values[frame] ?? Number.NaN;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return high >= low ? [high, low] : null;
}
