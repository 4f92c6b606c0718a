/** How far the lids of followed eyes are from open, picture by picture, and the blinks among it. */

import type { Followed } from "./follow-eyes";
import type { Grey } from "./grey";
import { cut } from "./patches";
import type { Point } from "./points";

const COLUMNS = 20;
const ROWS = 14;
const EYE = COLUMNS * ROWS;
/** The patch of one eye, in its widths. */
const WIDE = 1.4;
/** Where an open eye is looked for, in times of the pictures that a blink needs. */
const AROUND = [-4, -3, -2, -1, 1, 2, 3, 4];
const ROUNDS = 4;
const LEAST_CLOSED = 0.4;
/** Blinks that a further round learns from. */
const LEARNT = 12;
/** Share of the strongest change from which a place counts to the eye. */
const MARKED = 0.2;

export interface LidChanges {
  /** 0 as around it, 1 as in the blinks it was learnt from. */
  readonly closed: Float64Array;
  /** Pictures of blinks, most closed first. */
  readonly blinks: readonly number[];
  /** How much of the change in those blinks is the same in all. */
  readonly alike: number;
  /** What a blink changes, patch by patch. */
  readonly learnt: Float64Array;
  /** Spread of the rest, robust. */
  readonly noise: number;
  /** Per eye how closed it is in the blinks, as a share. */
  readonly shares: readonly number[];
}

function lookOf(picture: Grey, { places }: Followed): Float64Array {
  const patch = { columns: COLUMNS, rows: ROWS, step: (WIDE * places.width) / COLUMNS };
  const parts = places.centres.map((centre) => cut(picture, centre, patch));
  const look = new Float64Array(parts.length * EYE);
  parts.forEach((part, eye) => {
    const mean = part.reduce((sum, value) => sum + value, 0) / part.length;
    part.forEach((value, cell) => (look[eye * EYE + cell] = value - mean));
  });
  return look;
}

/** Each look without the middle one of those around it. */
function changesOf(looks: readonly Float64Array[], aside: number): Float64Array[] {
  return looks.map((look, index) => {
    const around = AROUND.flatMap((times) => looks[index + times * aside] ?? []);
    if (around.length < 2) return look.map(() => 0);
    return look.map((value, cell) => value - median(around.map((other) => other[cell] ?? 0)));
  });
}

function median(values: number[]): number {
  const sorted = values.sort((a, b) => a - b);
  const half = Math.floor(sorted.length / 2);
  return sorted.length % 2 === 1 ? (sorted[half] ?? 0) : ((sorted[half - 1] ?? 0) + (sorted[half] ?? 0)) / 2;
}

function dot(a: Float64Array, b: Float64Array, from = 0, until = a.length): number {
  let sum = 0;
  for (let cell = from; cell < until; cell += 1) sum += (a[cell] ?? 0) * (b[cell] ?? 0);
  return sum;
}

function meanOf(changes: readonly Float64Array[]): Float64Array {
  const mean = new Float64Array(changes[0]?.length ?? 0);
  for (const change of changes) change.forEach((value, cell) => (mean[cell] = (mean[cell] ?? 0) + value / changes.length));
  return mean;
}

/** Learn what a blink changes from the `moments` it was found at, and find every blink by it. */
export function lidChanges(
  pictures: readonly Grey[],
  followed: readonly Followed[],
  moments: readonly number[],
  aside: number,
): LidChanges {
  const looks = pictures.flatMap((picture, index) => (followed[index] ? [lookOf(picture, followed[index])] : []));
  const changes = changesOf(looks, aside);
  let blinks: number[] = moments.slice(0, LEARNT);
  let closed: Float64Array = new Float64Array(changes.length);
  let learnt: Float64Array = new Float64Array(0);
  for (let round = 0; round < ROUNDS; round += 1) {
    const taught = meanOf(blinks.slice(0, LEARNT).flatMap((index) => changes[index] ?? []));
    const norm = dot(taught, taught);
    if (!(norm > 0)) break;
    learnt = taught;
    closed = Float64Array.from(changes, (change) => dot(change, taught) / norm);
    blinks = peaksOf(closed, aside);
  }
  const noise = 1.48 * median([...closed].map(Math.abs));
  return {
    closed,
    blinks,
    noise,
    learnt,
    ...likenessOf(
      blinks.slice(0, LEARNT).flatMap((index) => changes[index] ?? []),
      learnt,
    ),
  };
}

function likenessOf(changes: readonly Float64Array[], learnt: Float64Array): Pick<LidChanges, "alike" | "shares"> {
  const alike = median(changes.map((change) => dot(change, learnt) ** 2 / (dot(learnt, learnt) * dot(change, change))));
  const shares = Array.from({ length: learnt.length / EYE }, (_, eye) => {
    const span = [eye * EYE, (eye + 1) * EYE] as const;
    return median(changes.map((change) => dot(change, learnt, ...span) / dot(learnt, learnt, ...span)));
  });
  return { alike, shares };
}

/** From where an eye was followed to the middle of what its blinks change, in its widths. */
export function offsetsOf(learnt: Float64Array): Point[] {
  return Array.from({ length: learnt.length / EYE }, (_, eye) => {
    const energy = learnt.slice(eye * EYE, (eye + 1) * EYE).map((value) => value ** 2);
    const least = MARKED * Math.max(...energy);
    let [sum, x, y] = [0, 0, 0];
    energy.forEach((value, cell) => {
      if (value < least) return;
      sum += value;
      x += value * ((cell % COLUMNS) - (COLUMNS - 1) / 2);
      y += value * (Math.floor(cell / COLUMNS) - (ROWS - 1) / 2);
    });
    return sum > 0 ? [(x / sum / COLUMNS) * WIDE, (y / sum / COLUMNS) * WIDE] : [0, 0];
  });
}

/** Pictures more closed than both sides of them a blink's length away, the most closed first. */
function peaksOf(closed: Float64Array, aside: number): number[] {
  const rise = closed.map((value, index) => {
    const sides = [Math.max(0, index - aside), Math.min(closed.length - 1, index + aside)].map((side) => closed[side] ?? 0);
    return value - Math.max(...sides.map((side) => Math.max(0, side)));
  });
  const order = [...closed.keys()].filter((index) => (rise[index] ?? 0) >= LEAST_CLOSED);
  order.sort((a, b) => (closed[b] ?? 0) - (closed[a] ?? 0));
  const peaks: number[] = [];
  for (const index of order) if (peaks.every((peak) => Math.abs(peak - index) > aside)) peaks.push(index);
  return peaks;
}
