/** The slider below the clip while it is shown: moved by pointer, by arrow keys, or evenly while a key is held. */
import type { ShownContinuousRating } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h, uniqueId } from "../../../ui/element";
import { absoluteNow } from "../../playback/protocol";
import "./track.css";

// From the slider's movements to its place at sampled frames: both have times of one clock, so nothing is timed again.

/** The slider is at `value` from `at_ms` (absolute) on. */
interface Move {
  at_ms: number;
  value: number;
}

const REST_MS = 300;

/** Whether a move at this time begins a movement: the first one does, however soon it comes, and each after a rest. */
export function begins(moves: readonly Move[], at_ms: number): boolean {
  const before = moves.at(-1);
  return moves.length < 2 || !before || at_ms - before.at_ms > REST_MS;
}

export function stepFrames(fps: number, sample_hz: number): number {
  return Math.max(1, Math.round(fps / sample_hz));
}

/**
 * The slider's place when frames 0, `step`, 2 `step` and so on were drawn. A frame that was not drawn lies between its
 * neighbors in time; after the last one that was, frames follow at the clip's rate.
 */
export function traceOf(
  moves: readonly Move[],
  drawn: readonly (readonly [number, number])[],
  frames: number,
  fps: number,
  step: number,
): number[] {
  const values: number[] = [];
  let index = 0;
  let current = moves[0]?.value ?? 0;
  for (let frame = 0; frame < frames; frame += step) {
    const at_ms = timeOf(frame, drawn, fps);
    for (let next = moves[index]; next && next.at_ms <= at_ms; next = moves[index]) {
      current = next.value;
      index += 1;
    }
    values.push(current);
  }
  return values;
}

function timeOf(frame: number, drawn: readonly (readonly [number, number])[], fps: number): number {
  const after = drawn.findIndex(([index]) => index >= frame);
  const [later, earlier] = [drawn[after], drawn[after < 0 ? drawn.length - 1 : after - 1]];
  // A frame before the first that was drawn is dated back at the clip's rate.
  if (later && (later[0] === frame || !earlier)) return later[1] - ((later[0] - frame) * 1000) / fps;
  if (!earlier) return 0;
  if (!later) return earlier[1] + ((frame - earlier[0]) * 1000) / fps;
  return earlier[1] + ((later[1] - earlier[1]) * (frame - earlier[0])) / (later[0] - earlier[0]);
}

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
  // Else the browser would move the slider by its own step as well.
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
      // A frame's time may be earlier than that of a key pressed during it.
      input.valueAsNumber += direction * a_ms * Math.max(0, now_ms - since_ms);
      noted(performance.timeOrigin + now_ms);
    }
    since_ms = Math.max(since_ms, now_ms);
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
      // A key that is held down repeats its event.
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
      // Another key may have taken over: only the one that moves the slider stops it.
      if (DIRECTION[event.key] !== direction) return;
      advance(event.timeStamp);
      direction = 0;
    },
    { signal },
  );
}
