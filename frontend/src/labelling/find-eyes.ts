/** Where eyes may be: spots that change together for a moment, again and again. Which of them are eyes, following them tells. */

import { alignedChange } from "./aligned-change";
import { BLOCK_PX, briefChange, type Spot, spotsOf, Sums } from "./brief-spots";
import { type EyePlaces, WIDTH_OF_DISTANCE } from "./eyes";
import { type BlockMeans, blockMeans, type Grey } from "./grey";
import type { Point } from "./points";

/** Widths of eyes looked for, in squares: of two eyes, and of one that may fill the picture. */
const PAIR_WIDTHS = [2, 3, 4, 6, 8, 11];
const LONE_WIDTHS = [16, 22, 30, 40, 52];
/** Distance of two eyes in widths of the spots, which are narrower than the eyes. */
const DISTANCES = [1.5, 3.6] as const;
const MAX_TILT = 0.35;
/** The weaker spot of two has at least this share of the stronger one's change. */
const LEAST_BALANCE = 0.35;
/** Grey levels by the share of all change nearby; noise of sensors stays below. */
const LEAST_SCORE = 0.6;
/** Grey levels by which the eyes change more than twice what is beside them. */
const LEAST_STILLED = 1;
const GUESSES_A_PICTURE = 3;
const GUESSES = 4;
/** Eyes of one group lie within so many of their distances (one eye: widths) of one another. */
const SAME_PLACE = 0.35;
const SAME_SIZE = 0.25;

interface Moment {
  readonly index: number;
  readonly spots: readonly Spot[];
  /** Distance of two eyes, width of one; in squares. */
  readonly extent: number;
  readonly middle: Point;
  readonly score: number;
}

/** Places of eyes guessed from changes that recur there. */
export interface Guess {
  readonly score: number;
  /** The picture on which the change was most marked. */
  readonly index: number;
  readonly places: EyePlaces;
  /** The pictures of all its changes, most marked first. */
  readonly moments: readonly number[];
}

/** The likeliest places of two eyes, or of one; `aside` pictures before and after a blink the lids are open. */
export function guessEyes(pictures: readonly Grey[], eyes: 1 | 2, aside: number, tell: (share: number) => void = () => undefined): Guess[] {
  const coarse = pictures.map((picture) => blockMeans(picture, BLOCK_PX));
  const moments = coarse.flatMap((now, index) => {
    tell(index / coarse.length);
    const [before, after] = [coarse[Math.max(0, index - aside)], coarse[Math.min(coarse.length - 1, index + aside)]];
    if (before === undefined || after === undefined || coarse.length < 3) return [];
    return momentsOf(briefChange(before, now, after), index, eyes);
  });
  const sides = (index: number): readonly [Grey, Grey, Grey] | null => {
    const [before, now, after] = [
      pictures[Math.max(0, index - aside)],
      pictures[index],
      pictures[Math.min(pictures.length - 1, index + aside)],
    ];
    return before && now && after ? [before, now, after] : null;
  };
  return grouped(
    moments.flatMap((moment) => stilled(moment, sides(moment.index))),
    aside,
  ).map(guessOf);
}

/** A moment judged by what is left of its change once the region's motion is taken out; none where that is little. */
function stilled(moment: Moment, sides: readonly [Grey, Grey, Grey] | null): Moment[] {
  if (sides === null) return [];
  const { eyes, beside } = alignedChange(sides, placesOf(moment));
  const [weakest, strongest] = [Math.min(...eyes), Math.max(...eyes)];
  const score = weakest - 2 * beside;
  return score >= LEAST_STILLED && weakest >= LEAST_BALANCE * strongest ? [{ ...moment, score }] : [];
}

function placesOf({ spots, extent }: Moment): EyePlaces {
  const centres = spots.map(({ x, y }): Point => [x * BLOCK_PX - 0.5, y * BLOCK_PX - 0.5]);
  return { centres, width: (spots.length === 2 ? WIDTH_OF_DISTANCE : 1) * extent * BLOCK_PX };
}

/** The strongest pairs, or single spots, of one picture's change. */
function momentsOf(change: BlockMeans, index: number, eyes: 1 | 2): Moment[] {
  const sums = new Sums(change);
  const moments = (eyes === 2 ? PAIR_WIDTHS : LONE_WIDTHS)
    .filter((width) => width * (eyes === 2 ? 2.5 : 1) <= change.across)
    .flatMap((width) => {
      const spots = spotsOf(change, sums, width);
      return eyes === 2 ? pairsOf(spots, width, sums, index) : spots.map((spot) => loneOf(spot, width, sums, index));
    })
    .filter(({ score }) => score >= LEAST_SCORE);
  return moments.sort((a, b) => b.score - a.score).slice(0, GUESSES_A_PICTURE);
}

function pairsOf(spots: readonly Spot[], width: number, sums: Sums, index: number): Moment[] {
  return spots.flatMap((left) =>
    spots.flatMap((right) => {
      const [dx, dy] = [right.x - left.x, right.y - left.y];
      if (dx < DISTANCES[0] * width || dx > DISTANCES[1] * width || Math.abs(dy) > MAX_TILT * dx) return [];
      const [weaker, stronger] = [Math.min(left.strength, right.strength), Math.max(left.strength, right.strength)];
      if (weaker < LEAST_BALANCE * stronger) return [];
      const extent = Math.hypot(dx, dy);
      const middle: Point = [(left.x + right.x) / 2, (left.y + right.y) / 2];
      const share = shareIn(sums, [left, right], width, [2.6 * extent, 1.6 * extent], middle);
      return [{ index, spots: [left, right], extent, middle, score: weaker * share }];
    }),
  );
}

function loneOf(spot: Spot, width: number, sums: Sums, index: number): Moment {
  const middle: Point = [spot.x, spot.y];
  const share = shareIn(sums, [spot], width, [4 * width, 3 * width], middle);
  return { index, spots: [spot], extent: width, middle, score: spot.strength * share };
}

/** How much of all change in an area lies in the spots. */
function shareIn(sums: Sums, spots: readonly Spot[], width: number, [wide, high]: Point, [x, y]: Point): number {
  const inside = spots.map((spot) => sums.box(spot.x - 0.7 * width, spot.y - 0.45 * width, 1.4 * width, 0.9 * width)[0]);
  const [all] = sums.box(x - wide / 2, y - high / 2, wide, high);
  return all > 0 ? Math.min(1, inside.reduce((sum, part) => sum + part, 0) / all) : 0;
}

interface Group {
  readonly moments: readonly Moment[];
  readonly score: number;
}

/** Moments of one place and size, at most one a blink; the likeliest groups of different places. */
function grouped(moments: readonly Moment[], aside: number): Group[] {
  const sorted = [...moments].sort((a, b) => b.score - a.score);
  const groups: Group[] = [];
  const taken: Moment[] = [];
  for (const first of sorted.slice(0, 400)) {
    if (taken.some((other) => isAlike(first, other))) continue;
    const members = apart(
      sorted.filter((other) => isAlike(first, other)),
      aside,
    );
    taken.push(first);
    groups.push({ moments: members, score: members.slice(0, 12).reduce((sum, { score }) => sum + score, 0) });
  }
  return groups.sort((a, b) => b.score - a.score).slice(0, GUESSES);
}

function isAlike(a: Moment, b: Moment): boolean {
  const reach = SAME_PLACE * a.extent;
  const isNear = Math.hypot(a.middle[0] - b.middle[0], a.middle[1] - b.middle[1]) <= reach;
  return isNear && Math.abs(Math.log(a.extent / b.extent)) <= SAME_SIZE;
}

/** The strongest moments, none within a blink's length of a stronger one. */
function apart(sorted: readonly Moment[], aside: number): Moment[] {
  const kept: Moment[] = [];
  for (const moment of sorted) {
    if (kept.every(({ index }) => Math.abs(index - moment.index) > aside)) kept.push(moment);
  }
  return kept;
}

function guessOf({ moments, score }: Group): Guess {
  const first = moments[0];
  if (first === undefined) throw new RangeError("expected a group with a moment, got none");
  return { score, index: first.index, places: placesOf(first), moments: moments.map(({ index }) => index) };
}
