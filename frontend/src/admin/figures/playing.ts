/** From a curve at its own sampling rate to what is shown frame by frame. */

/** Closure at each frame of `shownFps`, open before and after; by straight lines between samples. */
export function framesAt(closure: readonly number[], fps: number, shownFps: number): number[] {
  const length = Math.ceil(((closure.length - 1) / fps) * shownFps) + 1;
  const inside = Array.from({ length }, (_, frame) => valueAt(closure, (frame * fps) / shownFps));
  return [0, ...inside, 0];
}

function valueAt(values: readonly number[], position: number): number {
  const last = values.length - 1;
  const before = Math.min(last, Math.floor(position));
  const [left = 0, right = 0] = [values[before], values[Math.min(last, before + 1)]];
  return left + Math.min(1, position - before) * (right - left);
}
