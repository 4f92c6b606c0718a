/**
 * How the participant acts, summed up between two answers: presses, whether the browser made them, how long they
 * lasted. Only counts and one median leave the page; which keys were pressed and where is not even kept here.
 */
import type { Interaction } from "../../api/schema";
import { within } from "../measured";

const MAX_KEPT = 200;
const LONGEST_MS = 1e10;

export class InteractionLog {
  private presses = 0;
  private trusted = 0;
  private moves = 0;
  private press_ms: number[] = [];
  private readonly down = new Map<string, number>();

  /** Listen until `signal` is aborted. */
  constructor(target: EventTarget, signal: AbortSignal) {
    const options = { capture: true, passive: true, signal };
    for (const type of ["keydown", "pointerdown"]) target.addEventListener(type, (event) => this.pressed(event), options);
    for (const type of ["keyup", "pointerup"]) target.addEventListener(type, (event) => this.released(event), options);
    target.addEventListener("click", (event) => this.clicked(event), options);
    target.addEventListener("pointermove", () => (this.moves += 1), options);
  }

  /** What happened since the last call. */
  take(): Interaction {
    const sorted = [...this.press_ms].sort((a, b) => a - b);
    const median = sorted[Math.floor(sorted.length / 2)] ?? null;
    const summary = {
      presses: this.presses,
      trusted: this.trusted,
      press_ms: within(median, 0, LONGEST_MS) === null ? null : Math.round((median ?? 0) * 10) / 10,
      moves: this.moves,
    };
    this.presses = this.trusted = this.moves = 0;
    this.press_ms = [];
    return summary;
  }

  private pressed(event: Event): void {
    if (event instanceof KeyboardEvent && event.repeat) return;
    this.count(event);
    this.down.set(nameOf(event), event.timeStamp);
  }

  private released(event: Event): void {
    const name = nameOf(event);
    const since = this.down.get(name);
    this.down.delete(name);
    if (since !== undefined && this.press_ms.length < MAX_KEPT) this.press_ms.push(event.timeStamp - since);
  }

  /** An activation without a press before it: a script, a switch, speech or a screen reader made it. */
  private clicked(event: Event): void {
    if (event instanceof MouseEvent && event.detail === 0 && this.down.size === 0) this.count(event);
  }

  private count(event: Event): void {
    this.presses += 1;
    if (event.isTrusted) this.trusted += 1;
  }
}

function nameOf(event: Event): string {
  return event instanceof KeyboardEvent ? `key ${event.code}` : "pointer";
}
