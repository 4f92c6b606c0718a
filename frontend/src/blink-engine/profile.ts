/** The course of one blink, as in blink_engine/profile.py (equations 1 to 3 there). */

export interface BlinkShape {
  closing_s: number;
  closed_s: number;
  opening_s: number;
  closing_power: number;
  opening_power: number;
}

const smooth = (u: number): number => u * u * u * (10 + u * (6 * u - 15));

export const duration = (shape: BlinkShape): number => shape.closing_s + shape.closed_s + shape.opening_s;

/** How far the lid is on its way, 0 to 1, at one moment after the onset. */
export function courseAt(shape: BlinkShape, time_s: number): number {
  if (time_s <= 0 || time_s >= duration(shape)) return 0;
  if (time_s < shape.closing_s) return smooth((time_s / shape.closing_s) ** shape.closing_power);
  const since = time_s - shape.closing_s - shape.closed_s;
  if (since <= 0) return 1;
  return 1 - smooth(Math.min(1, since / shape.opening_s) ** shape.opening_power);
}
