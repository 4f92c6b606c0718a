import { describe, expect, it } from "vitest";
import { browserName, soon } from "../../src/admin/ui/format";
import { framesAt } from "../../src/admin/figures/Character";
import { nearest } from "../../src/playground/faces";
import { merge } from "../../src/admin/monitor/MonitorTab";

describe("a curve played at another rate", () => {
  it("keeps its length in time, and is open before and after", () => {
    const blink = Array.from({ length: 91 }, (_, sample) => 1 - Math.abs(sample - 45) / 45);
    const frames = framesAt(blink, 300, 30);
    expect(frames).toHaveLength(2 + 10);
    expect([frames[0], frames.at(-1)]).toEqual([0, 0]);
    expect(frames[1 + 3]).toBeCloseTo(blink[30] ?? 0);
    expect(Math.max(...frames)).toBeLessThanOrEqual(1);
  });

  it("chooses the nearest picture", () => {
    const steps = [0, 0.25, 0.5, 0.75, 1];
    expect([0, 0.1, 0.13, 0.9, 1].map((value) => nearest(steps, value))).toEqual([0, 0, 1, 4, 4]);
  });
});

describe("the monitor's runs", () => {
  const snapshot = (...runs: [string, number][]) =>
    ({ runs: runs.map(([run, answered]) => ({ run, answered })) }) as unknown as Parameters<typeof merge>[1];

  it("are those reported last; the others stay as they are", () => {
    const before = snapshot(["a", 1], ["b", 1]);
    const after = merge(before, snapshot(["b", 2], ["c", 0]));
    expect(after.runs.map(({ run, answered }) => [run, answered])).toEqual([
      ["a", 1],
      ["b", 2],
      ["c", 0],
    ]);
    expect(after.runs[0]).toBe(before.runs[0]);
  });
});

describe("words of the pages", () => {
  it("name a browser and its system", () => {
    expect(browserName("Mozilla/5.0 (Windows NT 10.0; Win64; x64) AppleWebKit/537.36 Chrome/140.0 Safari/537.36 Edg/140.0")).toBe(
      "Edge on Windows",
    );
    expect(browserName("curl/8.1")).toBe("curl/8.1");
    expect(browserName("")).toBe("unknown");
  });

  it("give the time alone for a moment of today", () => {
    expect(soon("2026-11-21T18:30:00", "2026-11-21T09:00:00")).not.toMatch(/Nov|21/);
    expect(soon("2026-11-23T18:30:00", "2026-11-21T09:00:00")).toMatch(/23/);
    expect(soon(null, "2026-11-21T09:00:00")).toBe("–");
  });
});
