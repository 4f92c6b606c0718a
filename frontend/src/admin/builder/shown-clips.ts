/** The clips that one trial shows, in words, and whether they stand below one another. */

import { type Data, isTable } from "./data";

export interface ShownClips {
  readonly words: readonly string[];
  readonly stacked: boolean;
}

const IN_TURN = ["1st clip", "2nd clip"];

export function shownClips(trial: unknown): ShownClips {
  if (!isTable(trial)) return { words: ["clip"], stacked: false };
  if (trial["kind"] === "paired_comparison") return pair(within(trial, "presentation")["arrangement"]);
  if (trial["kind"] === "threshold" && within(trial, "task")["asks"] === "two_interval") return { words: IN_TURN, stacked: false };
  return { words: isTable(trial["reference"]) ? ["reference", "clip"] : ["clip"], stacked: false };
}

function within(trial: Data, key: string): Data {
  const table = trial[key];
  return isTable(table) ? table : {};
}

function pair(arrangement: unknown): ShownClips {
  if (arrangement === "stacked") return { words: ["upper clip", "lower clip"], stacked: true };
  return { words: arrangement === "one_after_the_other" ? IN_TURN : ["left clip", "right clip"], stacked: false };
}
