/** The work of the blink review page: a series, its blinks, and the decisions about them with undo. */
import { useMemo, useState } from "react";
import { parseTable, type Table, TableProblem } from "../../labelling/csv";
import { begun, changed, type History, redone, undone } from "../../labelling/work";
import {
  type Blink,
  blinkKey,
  type BlinkTable,
  decide,
  type Decision,
  decisionOn,
  type Decisions,
  type Edge,
  parseBlinks,
  parseReview,
  reviewText,
  type ReviewRow,
  withDecision,
  withEdge,
  traceOf,
  type Window,
} from "../../labelling/review";
import { downloadText } from "../ui/useChange";

const NONE: Decisions = new Map();
/** Shown at first: ten seconds. */
const FIRST_WINDOW_S = 10;

export function useBlinkReview() {
  const [series, setSeries] = useState<Table | null>(null);
  const [table, setTable] = useState<BlinkTable | null>(null);
  const [lost, setLost] = useState<readonly ReviewRow[]>([]);
  const [history, setHistory] = useState<History<Decisions>>(begun(NONE));
  const [saved, setSaved] = useState<Decisions>(NONE);
  const [problem, setProblem] = useState<string | null>(null);
  const [reviewName, setReviewName] = useState("review.csv");
  const [column, setColumn] = useState<string | null>(null);
  const [chosenKey, setChosenKey] = useState<string | null>(null);
  const [chosenWindow, setChosenWindow] = useState<{ of: string; window: Window } | null>(null);
  const decisions = history.now;

  const columns = useMemo(() => [...new Set(table?.blinks.map((blink) => blink.column))], [table]);
  const shownColumn = column !== null && columns.includes(column) ? column : (columns[0] ?? null);
  const { values, wrong } = useMemo(() => readColumn(series, table, shownColumn), [series, table, shownColumn]);
  const blinks = useMemo(() => (table?.blinks ?? []).filter((blink) => blink.column === shownColumn), [table, shownColumn]);
  const chosen = blinks.find((blink) => blinkKey(blink) === chosenKey) ?? null;
  const last = (values?.length ?? 1) - 1;
  const fps = table?.fps ?? 1;

  // A part of one recording means nothing in a recording of another length.
  const recording = `${last} at ${fps}`;
  const window = chosenWindow?.of === recording ? chosenWindow.window : firstWindow(last, fps);
  const setWindow = (next: Window | ((before: Window) => Window)): void =>
    setChosenWindow((before) => {
      if (typeof next !== "function") return { of: recording, window: next };
      return { of: recording, window: next(before?.of === recording ? before.window : firstWindow(last, fps)) };
    });

  const reading = async (file: File, take: (name: string, text: string) => void): Promise<void> => {
    setProblem(null);
    try {
      take(file.name, await file.text());
    } catch (error) {
      if (!(error instanceof TableProblem)) throw error;
      setProblem(error.message);
    }
  };
  const begin = (next: Decisions): void => {
    setHistory(begun(next));
    setSaved(next);
  };

  const openBlinks = (file: File): Promise<void> =>
    reading(file, (name, text) => {
      const read = parseBlinks(name, text);
      setTable(read);
      setLost([]);
      setChosenKey(null);
      begin(read.decisions);
    });
  const openReview = (file: File): Promise<void> =>
    reading(file, (name, text) => {
      if (table === null) return;
      const review = decide(table.blinks, parseReview(name, text), table.fps);
      setReviewName(name);
      setLost(review.lost);
      begin(review.decisions);
    });

  const put = (next: Decisions, step: string | null = null): void => setHistory((before) => changed(before, next, step));
  const choose = (blink: Blink, centre = false): void => {
    setChosenKey(blinkKey(blink));
    const inView = blink.onset >= window.from && blink.end <= window.to;
    if (!centre && inView) return;
    const length = Math.min(window.to - window.from, last);
    const from = Math.max(0, Math.min(last - length, blink.minimum - length / 2));
    setWindow({ from, to: from + length });
  };

  return {
    hasSeries: series !== null,
    table,
    columns,
    column: shownColumn,
    setColumn,
    values,
    fps,
    last,
    blinks,
    decisions,
    chosen,
    window,
    setWindow,
    problem: problem ?? wrong,
    next: nextStep(series, table),
    lost,
    unsaved: decisions !== saved,
    canUndo: history.past.length > 0,
    canRedo: history.future.length > 0,
    openSeries: (file: File) => reading(file, (name, text) => setSeries(parseTable(name, text))),
    openBlinks,
    openReview,
    choose,
    step: (by: 1 | -1) => {
      const position = chosen === null ? (by === 1 ? -1 : blinks.length) : blinks.indexOf(chosen);
      const next = blinks[position + by];
      if (next !== undefined) choose(next);
    },
    decide: (blink: Blink, decision: Decision["decision"], reason: string) =>
      put(withDecision(decisions, blink, { ...decisionOn(decisions, blink), decision, reason })),
    restore: (blink: Blink) => put(withDecision(decisions, blink, { ...decisionOn(decisions, blink), onset: null, end: null })),
    moveEdge: (blink: Blink, edge: Edge, frame: number, step: string | null) =>
      put(withEdge(blink, edge, frame, blinks, decisions, last), step),
    undo: () => setHistory(undone),
    redo: () => setHistory(redone),
    save: () => {
      downloadText(reviewName, reviewText(table?.blinks ?? [], decisions, lost));
      setSaved(decisions);
    },
  };
}

function firstWindow(last: number, fps: number): Window {
  return { from: 0, to: Math.max(1, Math.min(last, FIRST_WINDOW_S * fps)) };
}

/** What is still to be opened before anything is drawn; null where nothing is, or where nothing is open at all. */
function nextStep(series: Table | null, table: BlinkTable | null): string | null {
  if (series !== null && table === null) return `${series.name} is open. Next, open its blinks: the CSV from “stimuli blinks”.`;
  if (series === null && table !== null) return "The blinks are open. Next, open their series or track.";
  return null;
}

interface Read {
  values: Float64Array | null;
  wrong: string | null;
}

function readColumn(series: Table | null, table: BlinkTable | null, column: string | null): Read {
  if (series === null || table === null || column === null) return { values: null, wrong: null };
  try {
    const values = traceOf(series, column);
    const beyond = table.blinks.find((blink) => blink.column === column && blink.end >= values.length);
    if (beyond === undefined) return { values, wrong: null };
    const wrong = `${series.name} ends at frame ${values.length - 1}, blink ${beyond.number} at ${beyond.end}; open the series that the blinks were found in`;
    return { values: null, wrong };
  } catch (error) {
    if (error instanceof TableProblem) return { values: null, wrong: error.message };
    throw error;
  }
}

export type BlinkReview = ReturnType<typeof useBlinkReview>;
