/** Eyes followed through a video from the moment they were found at, forwards and backwards. */

import { regionOf } from "./aligned-change";
import type { EyePlaces } from "./eyes";
import type { Grey } from "./grey";
import { cut, type Patch, searchFinely } from "./patches";
import type { Point } from "./points";

/** Steps of the region's grid that a head may move from one picture to the next. */
const REACH = 5;
/** Likeness from which a region is the same one; below `RENEWED` its look is taken anew once it stays so. */
const LEAST_LIKE = 0.5;
const RENEWED = 0.88;

/** The eyes on one picture. */
export interface Followed {
  readonly places: EyePlaces;
  /** Correlation of their surroundings with how these looked; low where they are lost. */
  readonly likeness: number;
}

interface Look {
  readonly values: Float64Array;
  readonly patch: Patch;
}

/** Where the eyes are on every picture; `aside` pictures before `start` they are open, and no blink lasts longer. */
export function followEyes(pictures: readonly Grey[], start: number, places: EyePlaces, aside: number): Followed[] {
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
