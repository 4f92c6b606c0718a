/** What the server has chosen anew after an answer, put in the place of trials that have not begun. */
import type { NextTrials, RatingSaved, TrialInfo } from "../../../api/schema";

const begun = new WeakSet<TrialInfo>();

/** From now on the trial keeps its clips, whatever the server chooses. */
export function begin(trial: TrialInfo): void {
  begun.add(trial);
}

export function nextOf(answer: unknown): NextTrials | null {
  return (answer as RatingSaved | null)?.next ?? null;
}

/** Change the run's trials; returns those that have other clips now. Trials of ended series count as answered. */
export function applyNext(trials: readonly TrialInfo[], next: NextTrials): TrialInfo[] {
  const at = new Map(trials.map((trial) => [trial.trial_index, trial]));
  const isOpen = (trial: TrialInfo | undefined): trial is TrialInfo => !!trial && !begun.has(trial) && trial.plays_done === 0;
  for (const index of next.closed) {
    const trial = at.get(index);
    if (isOpen(trial)) Object.assign(trial, { answered: true, plays_wanted: 0 } satisfies Partial<TrialInfo>);
  }
  return next.trials.flatMap((chosen) => {
    const trial = at.get(chosen.trial_index);
    if (!isOpen(trial) || trial.answered || (chosen.series?.known ?? 0) <= (trial.series?.known ?? -1)) return [];
    return [Object.assign(trial, chosen)];
  });
}
