/** Eyes of a video, found by their blinks: guessed, followed, and taken where what changes there behaves as lids do. */

import { type EyePlaces, type EyesOfVideo, type FoundEyes, WIDTH_OF_DISTANCE } from "./eyes";
import { guessEyes, type Guess } from "./find-eyes";
import { type Followed, followEyes } from "./follow-eyes";
import type { Grey } from "./grey";
import { type LidChanges, lidChanges, offsetsOf } from "./lid-changes";
import type { Point } from "./points";

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

/** Two eyes and one eye of a video; `seconds` from one picture to the next, `tell` hears the share that is done. */
export function seeEyes(pictures: readonly Grey[], seconds: number, tell: (share: number) => void): EyesOfVideo {
  const first = pictures[0];
  const size = [first?.width ?? 1, first?.height ?? 1] as const;
  const aside = Math.max(1, Math.round(ASIDE_SECONDS / seconds));
  const minutes = (pictures.length * seconds) / 60;
  const two = seen(pictures, 2, aside, minutes, (share) => tell(share / 2));
  const one = seen(pictures, 1, aside, minutes, (share) => tell((1 + share) / 2));
  return { size, two: two !== null && one !== null && isPartOf(two, one) ? null : two, one, problem: null };
}

function seen(pictures: readonly Grey[], eyes: 1 | 2, aside: number, minutes: number, tell: (share: number) => void): Seen | null {
  const guesses = guessEyes(pictures, eyes, aside, (share) => tell(0.6 * share)).slice(0, TRIED);
  for (const [tried, guess] of guesses.entries()) {
    tell(0.6 + (0.4 * tried) / TRIED);
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
