import { describe, expect, it } from "vitest";

import { begins, stepFrames, traceOf } from "../../src/participant/kinds/continuous_rating/track";

const drawn = (frames: number, except: number[] = []): [number, number][] =>
  Array.from({ length: frames }, (_, index): [number, number] => [index, 1_000 + index * 100]).filter(([index]) => !except.includes(index));

describe("a movement of the slider", () => {
  const at = (...times: number[]): { at_ms: number; value: number }[] => times.map((at_ms, value) => ({ at_ms, value }));
  it("begins with the first move, however soon after the slider is there, and after each rest", () => {
    expect(begins(at(1_000), 1_016)).toBe(true);
    expect(begins(at(1_000, 1_016), 1_032)).toBe(false);
    expect(begins(at(1_000, 1_016), 1_400)).toBe(true);
  });
});

describe("the trace of a continuous rating", () => {
  it("is the slider's place when each sampled frame was drawn", () => {
    const moves = [
      { at_ms: 0, value: 50 },
      { at_ms: 1_200, value: 60 },
      { at_ms: 1_390, value: 70 },
    ];
    expect(traceOf(moves, drawn(6), 6, 10, 1)).toEqual([50, 50, 60, 60, 70, 70]);
    expect(traceOf(moves, drawn(6), 6, 10, 2)).toEqual([50, 60, 70]);
  });

  it("puts frames that were not drawn between their neighbours, and after the last at the clip's rate", () => {
    const moves = [
      { at_ms: 0, value: 1 },
      { at_ms: 1_150, value: 2 },
      { at_ms: 1_450, value: 3 },
    ];
    expect(traceOf(moves, drawn(4, [1, 2]), 6, 10, 1)).toEqual([1, 1, 2, 2, 2, 3]);
    expect(traceOf(moves, drawn(4, [0]), 2, 10, 1)).toEqual([1, 1]);
    expect(traceOf(moves, [], 2, 10, 1)).toEqual([1, 1]);
  });

  it("has a value for every so manyth frame", () => {
    expect(stepFrames(30, 10)).toBe(3);
    expect(stepFrames(25, 10)).toBe(3);
    expect(stepFrames(24, 30)).toBe(1);
  });
});
