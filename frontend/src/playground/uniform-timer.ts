/** What most programs do today: one fixed blink after another, evenly spread waits between. */

const CLOSING_S = 0.1;
const CLOSED_S = 0.05;
const OPENING_S = 0.15;
const MIN_WAIT_S = 2;
const MAX_WAIT_S = 6;

export class UniformTimer {
  private onset_s: number;
  private readonly random: () => number;

  constructor(random: () => number = Math.random) {
    this.random = random;
    this.onset_s = this.wait();
  }

  /** Closure of both eyes at a moment that must not run backwards. */
  closure(time_s: number): number {
    while (time_s > this.onset_s + CLOSING_S + CLOSED_S + OPENING_S) this.onset_s += this.wait();
    const since = time_s - this.onset_s;
    if (since <= 0) return 0;
    if (since < CLOSING_S) return since / CLOSING_S;
    return Math.max(0, Math.min(1, 1 - (since - CLOSING_S - CLOSED_S) / OPENING_S));
  }

  private wait(): number {
    return MIN_WAIT_S + (MAX_WAIT_S - MIN_WAIT_S) * this.random();
  }
}
