import { describe, expect, it } from "vitest";
import { pointsOf, ticksOf } from "../../src/admin/kinds/continuous_rating/plots";

type Cell = Parameters<typeof pointsOf>[0];
type Data = Parameters<typeof ticksOf>[1];

const CELL: Cell = {
  cell: "a",
  people: 2,
  traces: 4,
  left_out: 0,
  times_s: [0, 0.1],
  mean: [50, 60],
  low: [40, 50],
  high: [60, 70],
  level: 55,
  blinks_s: [[0.05, 0.15], [0.1]],
};
const DATA = { minimum: -10, maximum: 10 } as Data;

describe("the figure of a cell", () => {
  it("has a point a sample, with its interval where there is one", () => {
    expect(pointsOf(CELL, "Anna")[1]).toEqual({ cell: "Anna", time_s: 0.1, mean: 60, low: 50, high: 70 });
    expect(pointsOf({ ...CELL, low: null, high: null }, "Anna")[0]).toEqual({
      cell: "Anna",
      time_s: 0,
      mean: 50,
      low: undefined,
      high: undefined,
    });
  });

  it("has one tick per blink and one row per clip, all below the scale", () => {
    const ticks = ticksOf(CELL, DATA);
    expect(ticks.map(({ time_s }) => time_s)).toEqual([0.05, 0.15, 0.1]);
    expect(ticks.every(({ from, to }) => from < to && to < DATA.minimum)).toBe(true);
    expect(ticks[0]?.from).toBe(ticks[1]?.from);
    expect(ticks[2]?.to).toBeLessThan(ticks[0]?.from ?? 0);
    expect(ticksOf({ ...CELL, blinks_s: [] }, DATA)).toEqual([]);
  });
});
