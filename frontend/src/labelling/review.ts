/** A second look at labeled blinks: the trace as it is drawn, and what was decided on each blink. */
import { requiredColumn, csvField, parseTable, type Table, TableProblem, wholeAt } from "./csv";

// Blinks as `stimuli blinks` writes them, and the review file that `stimuli blinks --review` reads.

const MATCH_FRAMES = 10;
const PAPER_FPS = 300;

export interface Blink {
  readonly number: number;
  readonly column: string;
  readonly onset: number;
  readonly minimum: number;
  readonly end: number;
  readonly closure: number;
}

/** A decision about a blink; `onset` and `end` are null where they stay as labeled. */
export interface Decision {
  readonly decision: "accept" | "reject";
  readonly reason: string;
  readonly onset: number | null;
  readonly end: number | null;
}

export interface ReviewRow extends Decision {
  readonly column: string;
  readonly minimum: number;
}

export interface BlinkTable {
  readonly blinks: readonly Blink[];
  readonly fps: number;
  /** Decisions that the table itself records, from the review that it was written with. */
  readonly decisions: Decisions;
}

/** Decisions by `blinkKey`; a blink that is not in it is as the labeling left it. */
export type Decisions = ReadonlyMap<string, Decision>;

export function blinkKey({ column, minimum }: Pick<Blink, "column" | "minimum">): string {
  return `${column}:${minimum}`;
}

const UNDECIDED: Decision = { decision: "accept", reason: "", onset: null, end: null };

export function decisionOn(decisions: Decisions, blink: Blink): Decision {
  return decisions.get(blinkKey(blink)) ?? UNDECIDED;
}

/** Read a blinks table; its rate follows from frames and seconds. */
export function parseBlinks(name: string, text: string): BlinkTable {
  const table = parseTable(name, text);
  const columns = Object.fromEntries(
    ["number", "column", "onset_frame", "minimum_frame", "end_frame", "end_s", "closure"].map((column) => [
      column,
      requiredColumn(table, column),
    ]),
  );
  const columnIndex = (column: string): number => columns[column] ?? 0;
  const [accepted, reason] = [table.header.indexOf("accepted"), table.header.indexOf("reason")];
  const decisions = new Map<string, Decision>();
  const blinks = table.rows.map((cells, row): Blink => {
    const whole = (column: string): number => wholeAt(table, row, columnIndex(column));
    const [onset, minimum, end] = [whole("onset_frame"), whole("minimum_frame"), whole("end_frame")];
    if (!(onset < minimum && minimum < end)) {
      throw new TableProblem(`${name} row ${row + 2}: expected onset_frame < minimum_frame < end_frame`);
    }
    const blink: Blink = {
      number: whole("number"),
      column: cells[columnIndex("column")] ?? "",
      onset,
      minimum,
      end,
      closure: Number(cells[columnIndex("closure")]),
    };
    if (cells[accepted]?.toLowerCase() === "false") {
      decisions.set(blinkKey(blink), { ...UNDECIDED, decision: "reject", reason: cells[reason] ?? "" });
    }
    return blink;
  });
  return { blinks, decisions, fps: rateOf(table, blinks, columnIndex("end_s")) };
}

function rateOf(table: Table, blinks: readonly Blink[], endSeconds: number): number {
  const last = blinks.reduce((best, blink, row) => (blink.end > (blinks[best]?.end ?? 0) ? row : best), 0);
  const fps = (blinks[last]?.end ?? 0) / Number(table.rows[last]?.[endSeconds]);
  if (Number.isFinite(fps) && fps > 0) return fps;
  throw new TableProblem(`${table.name} row ${last + 2}: end_s must be a time above 0`);
}

/** Read a review file, with or without the columns of moved starts and ends. */
export function parseReview(name: string, text: string): ReviewRow[] {
  const table = parseTable(name, text);
  const [column, minimum] = [requiredColumn(table, "column"), requiredColumn(table, "minimum_frame")];
  const [decision, reason] = [requiredColumn(table, "decision"), requiredColumn(table, "reason")];
  const [onset, end] = [table.header.indexOf("onset_frame"), table.header.indexOf("end_frame")];
  const moved = (row: number, cell: number): number | null =>
    cell < 0 || (table.rows[row]?.[cell] ?? "") === "" ? null : wholeAt(table, row, cell);
  return table.rows.map((cells, row) => {
    const word = cells[decision] ?? "";
    if (word !== "accept" && word !== "reject") {
      throw new TableProblem(`${name} row ${row + 2}: unknown decision '${word}'; expected accept or reject`);
    }
    return {
      column: cells[column] ?? "",
      minimum: wholeAt(table, row, minimum),
      decision: word,
      reason: cells[reason] ?? "",
      onset: moved(row, onset),
      end: moved(row, end),
    };
  });
}

/** Greatest distance in frames between a decision's minimum and its blink's. */
function matchFrames(fps: number): number {
  return Math.max(1, (MATCH_FRAMES * fps) / PAPER_FPS);
}

/** Decisions on the blinks they belong to, and the rows that match no blink (kept when the file is written). */
export function decide(blinks: readonly Blink[], rows: readonly ReviewRow[], fps: number): { decisions: Decisions; lost: ReviewRow[] } {
  const decisions = new Map<string, Decision>();
  const lost: ReviewRow[] = [];
  for (const row of rows) {
    const far = (blink: Blink): number => Math.abs(blink.minimum - row.minimum);
    const near = blinks.filter((blink) => blink.column === row.column && far(blink) <= matchFrames(fps));
    const [best] = near.sort((a, b) => far(a) - far(b));
    if (best === undefined) lost.push(row);
    else {
      const { decision, reason, onset, end } = row;
      decisions.set(blinkKey(best), { decision, reason, onset, end });
    }
  }
  return { decisions, lost };
}

/** Where a blink begins and ends, moves counted. */
export function edgesOf(blink: Blink, decisions: Decisions): { onset: number; end: number } {
  const { onset, end } = decisionOn(decisions, blink);
  return { onset: onset ?? blink.onset, end: end ?? blink.end };
}

export type Edge = "onset" | "end";

/** The frames a start or end may move to: not past the minimum, nor into the neighboring blink. */
export function edgeLimits(
  blink: Blink,
  edge: Edge,
  blinks: readonly Blink[],
  decisions: Decisions,
  lastFrame: number,
): [least: number, most: number] {
  const own = blinks.filter(({ column }) => column === blink.column);
  const now = edgesOf(blink, decisions);
  if (edge === "onset") {
    const ends = own.filter(({ minimum }) => minimum < blink.minimum).map((other) => edgesOf(other, decisions).end);
    return [Math.min(now.onset, Math.max(0, ...ends)), blink.minimum - 1];
  }
  const starts = own.filter(({ minimum }) => minimum > blink.minimum).map((other) => edgesOf(other, decisions).onset);
  return [blink.minimum + 1, Math.max(now.end, Math.min(lastFrame, ...starts))];
}

/** Decisions with a blink's start or end moved, held inside its limits. */
export function withEdge(
  blink: Blink,
  edge: Edge,
  frame: number,
  blinks: readonly Blink[],
  decisions: Decisions,
  lastFrame: number,
): Decisions {
  const [least, most] = edgeLimits(blink, edge, blinks, decisions, lastFrame);
  const edgeFrame = Math.round(Math.min(most, Math.max(least, frame)));
  const before = decisionOn(decisions, blink);
  if (edgesOf(blink, decisions)[edge] === edgeFrame) return decisions;
  return withDecision(decisions, blink, { ...before, [edge]: edgeFrame === blink[edge] ? null : edgeFrame });
}

/** Decisions with one in place; a blink left as labeled without a word is no longer in them. */
export function withDecision(decisions: Decisions, blink: Blink, decision: Decision): Decisions {
  const next = new Map(decisions);
  const plain = decision.decision === "accept" && decision.reason === "";
  if (plain && decision.onset === null && decision.end === null) next.delete(blinkKey(blink));
  else next.set(blinkKey(blink), decision);
  return next;
}

/** The text of a review file: all decisions, and rows that matched no blink; moved ends where there are any. */
export function reviewText(blinks: readonly Blink[], decisions: Decisions, lost: readonly ReviewRow[]): string {
  const rows = blinks
    .filter((blink) => decisions.has(blinkKey(blink)))
    .map((blink): ReviewRow => ({ column: blink.column, minimum: blink.minimum, ...decisionOn(decisions, blink) }));
  const all = [...lost, ...rows];
  const moves = all.some(({ onset, end }) => onset !== null || end !== null);
  const lines = all.map(({ column, minimum, decision, reason, onset, end }) =>
    [column, minimum, decision, reason, ...(moves ? [onset ?? "", end ?? ""] : [])].map(csvField).join(","),
  );
  return `${["column,minimum_frame,decision,reason" + (moves ? ",onset_frame,end_frame" : ""), ...lines].join("\n")}\n`;
}

// A distance over time, and its line in a window of a figure.

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
