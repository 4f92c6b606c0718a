/** Spots of a picture that change for a moment and are then as before: what blinking eyes do. */

import type { BlockMeans } from "./grey";

/** Side of the squares that are looked at as one, in pixels. */
export const BLOCK_PX = 4;
/** Spots kept of one picture and one size. */
const SPOTS = 6;
/** An eye's opening is half as high as it is wide. */
const HEIGHT_OF_WIDTH = 0.5;
/** The ring that a spot must outdo reaches so much farther out. */
const RING = 1.9;

export interface Spot {
  /** Its middle, in squares. */
  readonly x: number;
  readonly y: number;
  /** Mean change in it above that of the ring around it, in grey levels. */
  readonly strength: number;
}

/** By how much every square is brighter, or darker, than both before and after; 0 where it is between them. */
export function briefChange(before: BlockMeans, now: BlockMeans, after: BlockMeans): BlockMeans {
  const values = now.values.map((value, cell) => {
    const [since, until] = [value - (before.values[cell] ?? 0), value - (after.values[cell] ?? 0)];
    return since * until > 0 ? Math.min(Math.abs(since), Math.abs(until)) : 0;
  });
  return { across: now.across, down: now.down, values };
}

/** Sums of the squares above and left of every corner: the sum in any box is four of them. */
export class Sums {
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

/** The strongest spots as wide as an eye of `width` squares, none beside a stronger one. */
export function spotsOf(map: BlockMeans, sums: Sums, width: number): Spot[] {
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
