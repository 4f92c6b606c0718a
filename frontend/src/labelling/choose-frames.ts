/** Which frames to label: few, and as unlike one another as the recording allows. */

import { blockMeans, type Grey } from "./grey";

export const FRAMES_TO_LABEL = 20;
const FEW = 120;
const MANY = 1_200;
/** A closed lid stays for three frames or more at 30 a second. */
const STEP_FRAMES = 3;
/** Pictures before and after that a blink is unlike: 0.4 s at 30 frames a second. */
export const ASIDE = 4;
const BLOCK_PX = 4;
export const BRIEF_CHANGES = 8;

/** Frame numbers spread evenly over a video, first and last among them: every third, but 120 to 1,200 where it has as many. */
export function candidateFrames(frameCount: number): number[] {
  const count = Math.min(frameCount, Math.max(FEW, Math.min(MANY, Math.ceil((frameCount - 1) / STEP_FRAMES) + 1)));
  if (count < 2) return frameCount > 0 ? [0] : [];
  return Array.from({ length: count }, (_, index) => Math.round((index * (frameCount - 1)) / (count - 1)));
}

/** The most that any square is brighter, or darker, than both a little before and a little after. */
function briefness(before: Float32Array, now: Float32Array, after: Float32Array): number {
  let most = 0;
  for (let block = 0; block < now.length; block += 1) {
    const [since, until] = [(now[block] ?? 0) - (before[block] ?? 0), (now[block] ?? 0) - (after[block] ?? 0)];
    if (since * until > 0) most = Math.max(most, Math.min(Math.abs(since), Math.abs(until)));
  }
  return most;
}

/**
 * Places where a part of the picture changes and is soon as before, as when an eye blinks; the most marked first.
 *
 * Of a few pictures none: there the unlike ones hold the blinks.
 */
export function briefChanges(pictures: readonly Grey[], count = BRIEF_CHANGES): number[] {
  if (pictures.length <= FEW) return [];
  const means = pictures.map((picture) => blockMeans(picture, BLOCK_PX).values);
  const marked = means.map((now, index) => {
    const [before, after] = [means[index - ASIDE], means[index + ASIDE]];
    return before && after ? briefness(before, now, after) : 0;
  });
  const places: number[] = [];
  while (places.length < count) {
    const most = marked.reduce((best, value, index) => (value > (marked[best] ?? 0) ? index : best), 0);
    if (!((marked[most] ?? 0) > 0)) break;
    places.push(most);
    marked.fill(0, Math.max(0, most - ASIDE), most + ASIDE + 1);
  }
  return places;
}

/** Sum of squared differences of two pictures of one size. */
function difference(a: Grey, b: Grey): number {
  let sum = 0;
  for (let pixel = 0; pixel < a.values.length; pixel += 1) {
    sum += ((a.values[pixel] ?? 0) - (b.values[pixel] ?? 0)) ** 2;
  }
  return sum;
}

/**
 * Places of the pictures to take by farthest-point selection: each next one is the least like all taken before.
 *
 * `taken` are places already labelled; without any it begins at the first picture. Pictures equal to a taken one
 * are never taken, so fewer than `count` may come back. In ascending order, `taken` included.
 */
export function farthestPictures(pictures: readonly Grey[], count: number, taken: readonly number[] = []): number[] {
  const chosen = taken.length > 0 ? [...new Set(taken)] : pictures.length > 0 ? [0] : [];
  const nearest = pictures.map(() => Number.POSITIVE_INFINITY);
  const approach = (pictureIndex: number): void => {
    const picture = pictures[pictureIndex];
    if (picture === undefined) return;
    pictures.forEach((other, index) => {
      nearest[index] = Math.min(nearest[index] ?? 0, difference(picture, other));
    });
  };
  chosen.forEach(approach);
  while (chosen.length < count) {
    const farthest = Math.max(...nearest);
    if (!(farthest > 0)) break;
    const pictureIndex = nearest.indexOf(farthest);
    chosen.push(pictureIndex);
    approach(pictureIndex);
  }
  return chosen.sort((a, b) => a - b);
}
