import { describe, expect, it } from "vitest";
import { BlinkEngine, DEFAULT_PARAMETERS } from "../../src/blink-engine";
import { CONTROLS, numberPaths, valueAt, withValue, curveCsv, UniformTimer } from "../../src/playground/playground";

describe("the playground's controls", () => {
  it("are one for every number the engine draws by", () => {
    const numbers = numberPaths(DEFAULT_PARAMETERS).filter((path) => !path.startsWith("responses.blink."));
    expect(CONTROLS.map(({ path }) => path)).toEqual(numbers);
  });

  it.each(CONTROLS.map((control) => [control.path, control] as const))(
    "reach the default of %s and change it alone",
    (path, { min, max }) => {
      const value = valueAt(DEFAULT_PARAMETERS, path);
      expect(value).toBeGreaterThanOrEqual(min);
      expect(value).toBeLessThanOrEqual(max);
      const changed = withValue(DEFAULT_PARAMETERS, path, max);
      expect(valueAt(changed, path)).toBe(max);
      expect(withValue(changed, path, value)).toEqual(DEFAULT_PARAMETERS);
      const engine = new BlinkEngine({ parameters: changed });
      for (let frame = 0; frame < 600; frame += 1) expect(Number.isFinite(engine.frame(frame / 30).left)).toBe(true);
    },
  );
});

describe("a saved performance", () => {
  it("holds the engine's own curve", () => {
    const rows = curveCsv({ seed: 3, state: "speaking" }, { seconds: 20, fps: 30 }).trim().split("\n");
    const engine = new BlinkEngine({ seed: 3, state: "speaking" });
    expect(rows).toHaveLength(601);
    rows.slice(1).forEach((row, frame) => expect(Number(row.split(",")[2])).toBeCloseTo(engine.frame(frame / 30).left, 5));
  });
});

describe("the uniform timer", () => {
  it("blinks every 2 to 6 seconds, always alike", () => {
    const timer = new UniformTimer(() => 0.5);
    const closures = Array.from({ length: 3000 }, (_, frame) => timer.closure(frame / 100));
    const onsets = closures.flatMap((value, frame) => (value > 0 && (closures[frame - 1] ?? 0) === 0 ? [frame] : []));
    expect(onsets.length).toBeGreaterThan(5);
    onsets.slice(1).forEach((onset, index) => expect(onset - (onsets[index] ?? 0)).toBeCloseTo(400, -1));
    expect(Math.max(...closures)).toBe(1);
  });
});
