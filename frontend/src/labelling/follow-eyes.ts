/** Eyes followed through a video from the moment they were found at, forwards and backwards. */
import { regionOf, guessEyes, type Guess } from "./find-eyes";
import { type EyePlaces, type EyesOfVideo, type FoundEyes, WIDTH_OF_DISTANCE } from "./eyes";
import { type Grey, cut, type Patch, searchFinely } from "./grey";
import type { Point } from "./points";

/** Steps of the region's grid that a head may move from one picture to the next. */
const REACH = 5;
/** Likeness from which a region is the same one; below `RENEWED` its look is taken again once it stays so. */
const LEAST_LIKE = 0.5;
const RENEWED = 0.88;

/** The eyes on one picture. */
interface Followed {
  readonly places: EyePlaces;
  /** Correlation of their surroundings with how these looked; low where they are lost. */
  readonly likeness: number;
}

interface Look {
  readonly values: Float64Array;
  readonly patch: Patch;
}

/** Where the eyes are on every picture; `aside` pictures before `start` they are open, and no blink lasts longer. */
function followEyes(pictures: readonly Grey[], start: number, places: EyePlaces, aside: number): Followed[] {
  const followed = new Array<Followed>(pictures.length);
  const { middle, patch } = regionOf(places);
  const picture = pictures[start];
  if (picture === undefined) return [];
  const first: Look = { values: cut(picture, middle, patch), patch };
  for (const way of [1, -1]) {
    const walk = new Walk(first, places, middle, aside);
    for (let index = start; index >= 0 && index < pictures.length; index += way) {
      const here = pictures[index];
      if (here !== undefined) followed[index] = walk.to(here);
    }
  }
  return followed;
}

class Walk {
  private latest: Look;
  private at: Point;
  private unlike = 0;

  constructor(
    private readonly first: Look,
    private readonly places: EyePlaces,
    private readonly origin: Point,
    private readonly aside: number,
  ) {
    [this.latest, this.at] = [first, origin];
  }

  to(picture: Grey): Followed {
    const { patch } = this.first;
    const moved = searchFinely(picture, this.latest.values, this.at, patch, REACH);
    const there: Point = [this.at[0] + moved.dx, this.at[1] + moved.dy];
    // Where the first look is found too, its place is the one that does not drift.
    const again = searchFinely(picture, this.first.values, there, patch, 2);
    const isFirst = again.likeness >= moved.likeness - 0.04;
    if (isFirst || moved.likeness >= LEAST_LIKE) this.at = isFirst ? [there[0] + again.dx, there[1] + again.dy] : there;
    this.renew(picture, Math.max(moved.likeness, again.likeness));
    const [dx, dy] = [this.at[0] - this.origin[0], this.at[1] - this.origin[1]];
    const centres = this.places.centres.map(([x, y]): Point => [x + dx, y + dy]);
    return { places: { ...this.places, centres }, likeness: Math.max(moved.likeness, again.likeness) };
  }

  /** A look that has changed for longer than a blink lasts is the one to go on with. */
  private renew(picture: Grey, likeness: number): void {
    this.unlike = likeness < RENEWED && likeness >= LEAST_LIKE ? this.unlike + 1 : 0;
    if (this.unlike <= this.aside) return;
    this.latest = { values: cut(picture, this.at, this.first.patch), patch: this.first.patch };
    this.unlike = 0;
  }
}

// How far the lids of followed eyes are from open, picture by picture, and the blinks among it.

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

interface LidChanges {
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
function lidChanges(pictures: readonly Grey[], followed: readonly Followed[], moments: readonly number[], aside: number): LidChanges {
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
function offsetsOf(learnt: Float64Array): Point[] {
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

// Eyes of a video, found by their blinks: guessed, followed, and taken where what changes there behaves as lids do.

/** Seconds before and after a blink's lowest point at which the lids are open. */
const ASIDE_SECONDS = 0.3;
const TRIED = 3;
/** Blinks look alike, the lids rest between them, and both eyes close together. */
const LEAST_ALIKE = 0.55;
const MAX_NOISE = 0.15;
const LEAST_SHARE = 0.5;
const MAX_BLINKS_A_MINUTE = 40;
/** Pictures on which the surroundings of eyes are known again, as a share. */
const LEAST_KNOWN = 0.8;
const KNOWN = 0.5;
/** Spots so much nearer to one another than one eye around them is wide, and changing less than it, are parts of it. */
const WIDER_THAN_PAIR = 2.5;
/** The middle of what lids change lies above that of the corners: so much in widths of an eye, in our recordings. */
const LIDS_ABOVE = 0.12;

interface Seen extends FoundEyes {
  readonly score: number;
}

/** Two eyes and one eye of a video; `seconds` from one picture to the next, `report` receives the share that is done. */
export function seeEyes(pictures: readonly Grey[], seconds: number, report: (share: number) => void): EyesOfVideo {
  const first = pictures[0];
  const size = [first?.width ?? 1, first?.height ?? 1] as const;
  const aside = Math.max(1, Math.round(ASIDE_SECONDS / seconds));
  const minutes = (pictures.length * seconds) / 60;
  const two = seen(pictures, 2, aside, minutes, (share) => report(share / 2));
  const one = seen(pictures, 1, aside, minutes, (share) => report((1 + share) / 2));
  return { size, two: two !== null && one !== null && isPartOf(two, one) ? null : two, one, problem: null };
}

function seen(pictures: readonly Grey[], eyes: 1 | 2, aside: number, minutes: number, report: (share: number) => void): Seen | null {
  const guesses = guessEyes(pictures, eyes, aside, (share) => report(0.6 * share)).slice(0, TRIED);
  for (const [tried, guess] of guesses.entries()) {
    report(0.6 + (0.4 * tried) / TRIED);
    const followed = followEyes(pictures, guess.index, guess.places, aside);
    const lids = lidChanges(pictures, followed, guess.moments, aside);
    if (areLids(lids, followed, Math.max(1, minutes))) return foundOf(guess, followed, lids);
  }
  return null;
}

function areLids({ alike, noise, shares, blinks }: LidChanges, followed: readonly Followed[], minutes: number): boolean {
  const known = followed.filter(({ likeness }) => likeness >= KNOWN).length;
  return (
    blinks.length > 0 &&
    blinks.length <= MAX_BLINKS_A_MINUTE * minutes &&
    alike >= LEAST_ALIKE &&
    noise <= MAX_NOISE &&
    shares.every((share) => share >= LEAST_SHARE) &&
    known >= LEAST_KNOWN * followed.length
  );
}

function foundOf({ score, places }: Guess, followed: readonly Followed[], { blinks, closed, learnt }: LidChanges): Seen {
  const offsets = offsetsOf(learnt);
  const centres = followed.map((now) =>
    now.places.centres.map(([x, y], eye): Point => {
      const [dx, dy] = offsets[eye] ?? [0, 0];
      return [x + dx * places.width, y + (dy + LIDS_ABOVE) * places.width];
    }),
  );
  return { score, width: widthOf(centres[0] ?? [], places), centres, closed: [...closed], blinks };
}

function widthOf([first, second]: readonly Point[], places: EyePlaces): number {
  if (first === undefined || second === undefined) return places.width;
  return WIDTH_OF_DISTANCE * Math.hypot(second[0] - first[0], second[1] - first[1]);
}

/** Whether two spots lie in what one eye changes: the lashes or the corners of a close-up. */
function isPartOf(two: Seen, one: Seen): boolean {
  const [middle, places] = [one.centres[0]?.[0], two.centres[0] ?? []];
  if (middle === undefined || one.score < two.score || WIDER_THAN_PAIR * two.width > WIDTH_OF_DISTANCE * one.width) return false;
  return places.every(([x, y]) => Math.abs(x - middle[0]) <= 0.6 * one.width && Math.abs(y - middle[1]) <= 0.6 * one.width);
}
