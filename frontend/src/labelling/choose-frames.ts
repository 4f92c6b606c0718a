/** Which frames to label: few, and as unlike one another as the recording allows. */

import type { Grey } from "./grey";

export const FRAMES_TO_LABEL = 20;
const MAX_CANDIDATES = 120;

/** Frame numbers spread evenly over a video, first and last among them. */
export function candidateFrames(frameCount: number, most = MAX_CANDIDATES): number[] {
  const count = Math.min(frameCount, most);
  if (count < 2) return frameCount > 0 ? [0] : [];
  return Array.from({ length: count }, (_, index) => Math.round((index * (frameCount - 1)) / (count - 1)));
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
