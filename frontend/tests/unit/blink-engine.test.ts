import { describe, expect, it } from "vitest";
import vectors from "../../../tests/golden/blink_engine/vectors.json";
import { BlinkEngine, type BlinkEvent, DEFAULT_PARAMETERS, type Parameters, type StateName, withRate } from "../../src/blink-engine";
import { RandomNumbers } from "../../src/blink-engine/random-numbers";

const LIVELY: Parameters = {
  ...DEFAULT_PARAMETERS,
  intervals: { ...DEFAULT_PARAMETERS.intervals, rest: { kind: "gamma", median: 2.5, spread: 0.8 } },
  profile: { ...DEFAULT_PARAMETERS.profile, long_share: 0.2, double_share: 0.2 },
};

describe("random numbers", () => {
  it.each(vectors.numbers)("equal Python's to the bit for seed $seed, stream $stream", ({ seed, stream, integers, uniforms, normals }) => {
    const numbers = new RandomNumbers(seed, stream);
    expect(integers.map(() => numbers.integer())).toEqual(integers);
    expect(uniforms.map(() => numbers.uniform())).toEqual(uniforms);
    normals.forEach((normal) => expect(numbers.normal()).toBeCloseTo(normal, 12));
  });
});

type Happening = { time_s: number; state?: StateName; event?: BlinkEvent };

const HAPPENINGS: Happening[] = [
  ...vectors.changes.map(({ state, time_s }) => ({ time_s, state: state as StateName })),
  ...vectors.events.map((event) => ({ time_s: event.time_s, event: event as BlinkEvent })),
].sort((one, other) => one.time_s - other.time_s);

describe("the engine", () => {
  it.each(vectors.performances)("gives Python's curves: $state, $parameters", ({ seed, state, parameters, left, right }) => {
    const engine = new BlinkEngine({ seed, state: state as StateName, parameters: parameters === "lively" ? LIVELY : DEFAULT_PARAMETERS });
    const pending = [...HAPPENINGS];
    let worst = 0;
    left.forEach((expected, k) => {
      const time_s = k / 12.5;
      for (let next = pending[0]; next && next.time_s <= time_s; next = pending[0]) {
        pending.shift();
        if (next.event) engine.notify(next.event);
        else if (next.state) engine.setState(next.state, next.time_s);
      }
      const frame = engine.frame(time_s);
      worst = Math.max(worst, Math.abs(frame.left - expected), Math.abs(frame.right - (right[k] ?? NaN)));
    });
    expect(worst).toBeLessThan(1e-6);
  });

  it("gives Python's single frames, with gaze and squint", () => {
    const engine = new BlinkEngine({ seed: vectors.frames.seed });
    vectors.frames.given.forEach(([time_s = 0, gaze, squint], k) => {
      const frame = Object.values(engine.frame(time_s, gaze, squint)) as number[];
      vectors.frames.frames[k]?.forEach((expected, value) => expect(frame[value]).toBeCloseTo(expected, 9));
    });
  });

  it("holds blinks while a flag is up, as Python does", () => {
    const engine = new BlinkEngine({ seed: vectors.held.seed, state: vectors.held.state as StateName });
    vectors.held.left.forEach((expected, k) => {
      if (k % 70 === 0) engine.holdBlinks(k % 140 === 70, k / 10);
      expect(engine.frame(k / 10).left).toBeCloseTo(expected, 8);
    });
  });

  it("refuses a time that runs backwards, and a senseless rate", () => {
    const engine = new BlinkEngine();
    engine.frame(2);
    expect(() => engine.frame(1)).toThrow("at least 2 s");
    expect(() => engine.frame(NaN)).toThrow("expected a time");
    expect(() => withRate(DEFAULT_PARAMETERS, "rest", 0)).toThrow("0.1 to 60");
  });

  it("changes the rate as asked", () => {
    const engine = new BlinkEngine({ seed: 2, parameters: withRate(DEFAULT_PARAMETERS, "rest", 40) });
    let closures = 0;
    let before = 0;
    for (let k = 0; k < 60 * 60 * 10; k += 1) {
      const { left } = engine.frame(k / 60);
      if (before < 0.2 && left >= 0.2) closures += 1;
      before = left;
    }
    expect(closures / 10).toBeGreaterThan(30);
    expect(closures / 10).toBeLessThan(45);
  });
});
