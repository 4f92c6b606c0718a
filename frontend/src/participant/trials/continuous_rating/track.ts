/** The slider below the clip while it is shown: moved by pointer, by arrow keys, or evenly while a key is held. */
import type { ShownContinuousRating } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h, uniqueId } from "../../../ui/element";
import { absoluteNow } from "../../playback/protocol";
import "./track.css";
import { begins, type Move } from "./trace";

export interface Track {
  parts: HTMLElement[];
  moves: Move[];
  /** How often it began to move after it had rested. */
  started(): number;
  focus(): void;
}

const SAMPLES_A_STEP = 200;
const DIRECTION: Record<string, -1 | 1> = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };

/** Ends with `signal`. It begins in the middle. */
export function makeTrack(declared: ShownContinuousRating, language: string, signal: AbortSignal): Track {
  const { minimum, maximum, low, high, question } = declared;
  const id = uniqueId("question");
  const step = (maximum - minimum) / SAMPLES_A_STEP;
  const input = h("input", { type: "range", class: "track", min: minimum, max: maximum, step: "any", "aria-labelledby": id });
  const ends = [pick(low, language), pick(high, language)];
  input.valueAsNumber = (minimum + maximum) / 2;
  const moves: Move[] = [{ at_ms: absoluteNow(), value: input.valueAsNumber }];
  let starts = 0;

  function noted(at_ms: number): void {
    const value = Math.round(input.valueAsNumber * 100) / 100;
    if (moves.at(-1)?.value === value) return;
    if (begins(moves, at_ms)) starts += 1;
    moves.push({ at_ms, value });
    input.setAttribute("aria-valuetext", `${Math.round(input.valueAsNumber)} (${minimum} ${ends[0] ?? ""}, ${maximum} ${ends[1] ?? ""})`);
  }
  input.addEventListener("input", (event) => noted(performance.timeOrigin + event.timeStamp), { signal });
  if (declared.input === "keys") hold(input, (maximum - minimum) / (declared.seconds_across * 1000), noted, signal);
  else input.addEventListener("keydown", (event) => nudge(event, input, 4 * step, noted), { signal });
  return {
    parts: [
      h("h1", { class: "question", id }, pick(question, language)),
      input,
      h("div", { class: "track-ends", "aria-hidden": "true" }, h("span", {}, ends[0]), h("span", {}, ends[1])),
    ],
    moves,
    started: () => starts,
    focus: () => input.focus({ preventScroll: true }),
  };
}

function nudge(event: KeyboardEvent, input: HTMLInputElement, by: number, noted: (at_ms: number) => void): void {
  const direction = DIRECTION[event.key];
  if (direction === undefined) return;
  event.preventDefault();
  input.valueAsNumber += direction * by;
  noted(performance.timeOrigin + event.timeStamp);
}

/** While a key is down the slider moves `a_ms` each millisecond. */
function hold(input: HTMLInputElement, a_ms: number, noted: (at_ms: number) => void, signal: AbortSignal): void {
  let direction = 0;
  let since_ms = 0;
  const advance = (now_ms: number): void => {
    if (direction !== 0) {
      input.valueAsNumber += direction * a_ms * Math.max(0, now_ms - since_ms);
      noted(performance.timeOrigin + now_ms);
    }
    since_ms = now_ms;
  };
  const tick = (now_ms: number): void => {
    if (direction === 0 || signal.aborted) return;
    advance(now_ms);
    requestAnimationFrame(tick);
  };
  document.addEventListener(
    "keydown",
    (event) => {
      const pressed = DIRECTION[event.key];
      if (pressed === undefined) return;
      event.preventDefault();
      if (pressed === direction) return;
      advance(event.timeStamp);
      const resting = direction === 0;
      direction = pressed;
      if (resting) requestAnimationFrame(tick);
    },
    { signal },
  );
  document.addEventListener(
    "keyup",
    (event) => {
      if (DIRECTION[event.key] !== direction) return;
      advance(event.timeStamp);
      direction = 0;
    },
    { signal },
  );
}
