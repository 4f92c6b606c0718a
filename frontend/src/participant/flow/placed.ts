/** A run whose group an answer has just decided: its trials are known from now on. */
import type { RunState, Saved } from "../../api/schema";

/** The run as the page sees it: practice is no block. */
export function withoutPractice(run: RunState): RunState {
  return { ...run, blocks: run.blocks.filter(({ block }) => block > 0) };
}

/** Take over the run that the answer to a form brings, if it brings one. */
export function placed(run: RunState, answer: unknown): void {
  const anew = (answer as Saved | null)?.run;
  if (anew) Object.assign(run, withoutPractice(anew));
}
