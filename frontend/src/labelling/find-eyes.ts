/** Where eyes may be: spots that change together for a moment, again and again. Following them shows which of them are eyes. */
import { type EyePlaces, WIDTH_OF_DISTANCE } from "./eyes";
import { type Grey, cut, type Patch, searchFinely, type BlockMeans, blockMeans } from "./grey";
import type { Point } from "./points";

// How an eye region changes for a moment once the head's motion is taken out of it.

const COLUMNS = 32;
const REACH = 3;
/** A region is this many widths of an eye higher than one eye's opening, and wider than the outer corners of both. */
const MARGIN = 0.75;
/** Half the width and height of what lids change, in widths of an eye. */
const LIDS: Point = [0.55, 0.34];

/** Change of each eye and of the region around them, as means over their area, in gray levels. */
interface AlignedChange {
  readonly eyes: readonly number[];
  readonly around: number;
}

/** Middle of the eyes and a grid of points over them and what surrounds them. */
export function regionOf({ centres, width }: EyePlaces): { middle: Point; patch: Patch } {
  const [first, last] = [centres[0] ?? [0, 0], centres[centres.length - 1] ?? [0, 0]];
  const wide = Math.abs(last[0] - first[0]) + width * (1 + 2 * MARGIN);
  const step = wide / COLUMNS;
  const high = Math.abs(last[1] - first[1]) + width * (0.5 + 2 * MARGIN);
  const middle: Point = [(first[0] + last[0]) / 2, (first[1] + last[1]) / 2];
  return { middle, patch: { columns: COLUMNS, rows: Math.max(4, Math.round(high / step)), step } };
}

/** Luminance without its mean: the light of a whole region says nothing. */
function level(values: Float64Array): Float64Array {
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  return values.map((value) => value - mean);
}

/** The change at one moment against both sides of it, each laid on it by its best shift. */
function alignedChange([before, now, after]: readonly [Grey, Grey, Grey], places: EyePlaces): AlignedChange {
  const { middle, patch } = regionOf(places);
  const here = cut(now, middle, patch);
  const [then, later] = [before, after].map((side) => {
    const { dx, dy } = searchFinely(side, here, middle, patch, REACH);
    return level(cut(side, [middle[0] + dx, middle[1] + dy], patch));
  });
  const change = level(here).map((value, cell) => {
    const [since, until] = [value - (then?.[cell] ?? 0), value - (later?.[cell] ?? 0)];
    return since * until > 0 ? Math.min(Math.abs(since), Math.abs(until)) : 0;
  });
  return meansOf(change, places, middle, patch);
}

function meansOf(change: Float64Array, { centres, width }: EyePlaces, middle: Point, { columns, rows, step }: Patch): AlignedChange {
  const sums = [...centres, middle].map(() => [0, 0] as [number, number]);
  change.forEach((value, cell) => {
    const x = middle[0] + ((cell % columns) - (columns - 1) / 2) * step;
    const y = middle[1] + (Math.floor(cell / columns) - (rows - 1) / 2) * step;
    const eye = centres.findIndex((centre) => Math.abs(x - centre[0]) <= LIDS[0] * width && Math.abs(y - centre[1]) <= LIDS[1] * width);
    const sum = sums[eye < 0 ? centres.length : eye];
    if (sum !== undefined) [sum[0], sum[1]] = [sum[0] + value, sum[1] + 1];
  });
  const means = sums.map(([sum, count]) => sum / Math.max(1, count));
  return { eyes: means.slice(0, centres.length), around: means[centres.length] ?? 0 };
}

// Spots of a picture that change for a moment and are then as before: what blinking eyes do.

/** Side of the squares that are looked at as one, in pixels. */
const BLOCK_PX = 4;
/** Spots kept of one picture and one size. */
const SPOTS = 6;
/** An eye's opening is half as high as it is wide. */
const HEIGHT_OF_WIDTH = 0.5;
/** The ring that a spot must outdo reaches so much farther out. */
const RING = 1.9;

interface Spot {
  /** Its middle, in squares. */
  readonly x: number;
  readonly y: number;
  /** Mean change in it above that of the ring around it, in gray levels. */
  readonly strength: number;
}

/** By how much every square is brighter, or darker, than both before and after; 0 where it is between them. */
function briefChange(before: BlockMeans, now: BlockMeans, after: BlockMeans): BlockMeans {
  const values = now.values.map((value, cell) => {
    const [since, until] = [value - (before.values[cell] ?? 0), value - (after.values[cell] ?? 0)];
    return since * until > 0 ? Math.min(Math.abs(since), Math.abs(until)) : 0;
  });
  return { across: now.across, down: now.down, values };
}

/** Sums of the squares above and left of every corner: the sum in any box is four of them. */
class Sums {
  private readonly stride: number;
  private readonly sums: Float64Array;

  constructor(private readonly map: BlockMeans) {
    this.stride = map.across + 1;
    this.sums = new Float64Array(this.stride * (map.down + 1));
    for (let y = 0; y < map.down; y += 1) {
      let row = 0;
      for (let x = 0; x < map.across; x += 1) {
        row += map.values[y * map.across + x] ?? 0;
        this.sums[(y + 1) * this.stride + x + 1] = (this.sums[y * this.stride + x + 1] ?? 0) + row;
      }
    }
  }

  /** Sum in the part of a box that lies in the picture, and how many squares that part has. */
  box(left: number, top: number, width: number, height: number): readonly [sum: number, count: number] {
    const [x0, y0] = [clamp(left, this.map.across), clamp(top, this.map.down)];
    const [x1, y1] = [clamp(left + width, this.map.across), clamp(top + height, this.map.down)];
    const at = (x: number, y: number): number => this.sums[y * this.stride + x] ?? 0;
    return [at(x1, y1) - at(x0, y1) - at(x1, y0) + at(x0, y0), (x1 - x0) * (y1 - y0)];
  }
}

function clamp(value: number, most: number): number {
  return Math.min(most, Math.max(0, Math.round(value)));
}

/** The strongest spots as wide as an eye of `width` squares, none next to a stronger one. */
function spotsOf(map: BlockMeans, sums: Sums, width: number): Spot[] {
  const height = Math.max(1, Math.round(HEIGHT_OF_WIDTH * width));
  const [wide, high] = [Math.round(RING * width), Math.round(RING * height) + 1];
  const strengths = new Float32Array(map.across * map.down);
  for (let top = 0; top + height <= map.down; top += 1) {
    for (let left = 0; left + width <= map.across; left += 1) {
      const [inner, innerCount] = sums.box(left, top, width, height);
      const [outer, outerCount] = sums.box(left - (wide - width) / 2, top - (high - height) / 2, wide, high);
      strengths[top * map.across + left] = inner / innerCount - (outer - inner) / Math.max(1, outerCount - innerCount);
    }
  }
  return strongest(strengths, map, width, height);
}

function strongest(strengths: Float32Array, { across, down }: BlockMeans, width: number, height: number): Spot[] {
  const spots: Spot[] = [];
  while (spots.length < SPOTS) {
    let best = 0;
    for (let cell = 1; cell < strengths.length; cell += 1) if ((strengths[cell] ?? 0) > (strengths[best] ?? 0)) best = cell;
    const [strength, left, top] = [strengths[best] ?? 0, best % across, Math.floor(best / across)];
    if (!(strength > 0)) break;
    spots.push({ x: left + width / 2, y: top + height / 2, strength });
    for (let y = Math.max(0, top - height); y <= Math.min(down - 1, top + height); y += 1) {
      strengths.fill(0, y * across + Math.max(0, left - width), y * across + Math.min(across, left + width + 1));
    }
  }
  return spots;
}

/** Widths of eyes looked for, in squares: of two eyes, and of one that may fill the picture. */
const PAIR_WIDTHS = [2, 3, 4, 6, 8, 11];
const LONE_WIDTHS = [16, 22, 30, 40, 52];
/** Distance of two eyes in widths of the spots, which are narrower than the eyes. */
const DISTANCES = [1.5, 3.6] as const;
const MAX_TILT = 0.35;
/** The weaker spot of two has at least this share of the stronger one's change. */
const LEAST_BALANCE = 0.35;
/** Gray levels by the share of all change nearby; noise of sensors stays below. */
const LEAST_SCORE = 0.6;
/** Gray levels by which the eyes change more than twice the region around them. */
const LEAST_STILLED = 1;
const GUESSES_A_PICTURE = 3;
const GUESSES = 4;
/** Eyes of one group lie within this many of their distances (one eye: widths) of one another. */
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
export function guessEyes(
  pictures: readonly Grey[],
  eyes: 1 | 2,
  aside: number,
  report: (share: number) => void = () => undefined,
): Guess[] {
  const coarse = pictures.map((picture) => blockMeans(picture, BLOCK_PX));
  const moments = coarse.flatMap((now, index) => {
    report(index / coarse.length);
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
  const { eyes, around } = alignedChange(sides, placesOf(moment));
  const [weakest, strongest] = [Math.min(...eyes), Math.max(...eyes)];
  const score = weakest - 2 * around;
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

/** Moments of one place and size, at most one per blink; the likeliest groups of different places. */
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
