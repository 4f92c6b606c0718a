/** From the slider's movements to its place at sampled frames: both have times of one clock, so nothing is timed again. */

/** The slider stands at `value` from `at_ms` (absolute) on. */
export interface Move {
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
 * The slider's place when frames 0, `step`, 2 `step` and so on were drawn. A frame that was not drawn stands between its
 * neighbours in time; after the last one that was, frames follow at the clip's rate.
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
  if (later && (later[0] === frame || !earlier)) return later[1] - ((later[0] - frame) * 1000) / fps;
  if (!earlier) return 0;
  if (!later) return earlier[1] + ((frame - earlier[0]) * 1000) / fps;
  return earlier[1] + ((later[1] - earlier[1]) * (frame - earlier[0])) / (later[0] - earlier[0]);
}
