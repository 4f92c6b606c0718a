/** How an eye region changes for a moment once the head's motion is taken out of it. */

import type { EyePlaces } from "./eyes";
import type { Grey } from "./grey";
import { cut, type Patch, searchFinely } from "./patches";
import type { Point } from "./points";

const COLUMNS = 32;
const REACH = 3;
/** A region is so many widths of an eye higher than one eye's opening, and wider than the outer corners of both. */
const MARGIN = 0.75;
/** Half the width and height of what lids change, in widths of an eye. */
const LIDS: Point = [0.55, 0.34];

/** Change of each eye and of the region beside them, as means over their area, in grey levels. */
export interface AlignedChange {
  readonly eyes: readonly number[];
  readonly beside: number;
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
export function alignedChange([before, now, after]: readonly [Grey, Grey, Grey], places: EyePlaces): AlignedChange {
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
  return { eyes: means.slice(0, centres.length), beside: means[centres.length] ?? 0 };
}
