/** Clips that did not run as declared, waiting to be shown again at the end of their block. */
import type { TrialInfo } from "../../api/schema";

export interface Replay {
  trial: TrialInfo;
  play: number;
}

export class Replays {
  private queue: Replay[] = [];

  add(trial: TrialInfo, play: number): void {
    const known = this.queue.some((one) => one.trial.trial_index === trial.trial_index && one.play === play);
    if (!known) this.queue.push({ trial, play });
    trial.plays_wanted = Math.max(trial.plays_wanted, play);
  }

  /** A play that was begun and broken off is not shown again. */
  drop(trial: TrialInfo, play: number): void {
    this.queue = this.queue.filter((one) => one.trial.trial_index !== trial.trial_index || one.play !== play);
  }

  /** The next one of this block or an earlier one, whose receipt came late; it stays until `shift`. */
  peek(block: number): Replay | null {
    return this.queue.find((one) => one.trial.block <= block) ?? null;
  }

  shift(block: number): void {
    const next = this.peek(block);
    if (next) this.queue.splice(this.queue.indexOf(next), 1);
  }
}

/** What an earlier visit still owes: played, but wanted once more. */
export function owed(trials: readonly TrialInfo[]): Replay[] {
  return trials
    .filter((trial) => trial.plays_done > 0 && trial.plays_done < trial.plays_wanted)
    .map((trial) => ({ trial, play: trial.plays_done + 1 }));
}
