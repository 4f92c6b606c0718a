/** No number that a browser reports makes the page's own record invalid. */
import { describe, expect, it } from "vitest";
import { clockTime, count, duration, frameLog, offset, pixelRatio, pixels } from "../../src/participant/measured";
import { playbackRecord, type Showing } from "../../src/participant/playback/record";

const ODD = [NaN, Infinity, -Infinity, -57, -749.25, -1e-9, 0, 0.5, 1, 1e9, 1e11, 1e308, 2 ** 53, undefined, null, "7"] as number[];
const HASH = "a".repeat(64);

const showing = (changes: Partial<Showing> = {}): Showing => ({
  method: "video",
  key_at_ms: 1000,
  ended_at_ms: 1200,
  drawn: [
    [0, 1010],
    [1, 1043],
    [2, 1077],
  ],
  frames: 3,
  fps: 30,
  stalls: 0,
  clock_gap_ms: 17,
  clock_late_ms: 1,
  focus_lost: 0,
  disturbances: {},
  visible_share: 1,
  refresh_ms: 16.7,
  ...changes,
});

/** The server's bounds of each number, by its key. */
const COUNTS = ["frames_drawn", "frames_late", "frames_missing", "stalls", "focus_lost"] as const;
const TIMES = ["key_to_first_frame_ms", "longest_gap_ms", "clock_gap_ms"] as const;

function isValid(record: ReturnType<typeof playbackRecord>): boolean {
  const said = JSON.parse(JSON.stringify(record)) as typeof record;
  const isNumber = (value: number | null, low: number, high: number): boolean =>
    value === null || (typeof value === "number" && value >= low && value <= high);
  return (
    COUNTS.every((key) => isNumber(said[key], 0, 1e6) && (said[key] === null || Number.isInteger(said[key]))) &&
    TIMES.every((key) => isNumber(said[key], 0, 1e10)) &&
    isNumber(said.clock_late_ms, -1e10, 1e10) &&
    isNumber(said.refresh_rate_hz, 0, 10_000) &&
    isNumber(said.device_pixel_ratio, 0.001, 100) &&
    said.drawn.every(([index, ms]) => Number.isInteger(index) && index >= 0 && index <= 1e6 && Math.abs(ms) <= 1e10)
  );
}

describe("whatever the browser reports,", () => {
  it("each figure lies in its bounds or is unknown", () => {
    for (const value of ODD) {
      for (const known of [duration(value), count(value)]) expect(known === null || known >= 0).toBe(true);
      expect(offset(value) === null || Number.isFinite(offset(value))).toBe(true);
      expect(Number.isInteger(pixels(value)) && pixels(value) >= 0 && pixels(value) <= 100_000).toBe(true);
      expect(pixelRatio(value) === null || (pixelRatio(value) ?? 0) > 0).toBe(true);
      const moment = clockTime(value);
      expect(moment === null || /^[1-8]\d{3}-/.test(moment)).toBe(true);
    }
  });

  it("a negative time is unknown and not zero", () => {
    expect(duration(-57)).toBe(null);
    expect(clockTime(-1)).toBe(null);
    expect(
      frameLog([
        [0, NaN],
        [1, 33.333],
      ]),
    ).toEqual([[1, 33.33]]);
  });

  const keys = [
    "key_at_ms",
    "ended_at_ms",
    "frames",
    "fps",
    "stalls",
    "clock_gap_ms",
    "clock_late_ms",
    "focus_lost",
    "refresh_ms",
  ] as const;
  it.each(keys)("the record of a play is valid: %s", (key) => {
    for (const value of ODD)
      expect([value, isValid(playbackRecord(HASH, [showing({ [key]: value })], { refresh_rate_hz: 60, device_pixel_ratio: 1 }))]).toEqual([
        value,
        true,
      ]);
  });

  it("the record of a play is valid: drawn frames and the screen", () => {
    for (const value of ODD)
      for (const other of ODD) {
        const drawn: Showing["drawn"] = [
          [0, value],
          [other, value],
          [2, 1077],
        ];
        expect(isValid(playbackRecord(HASH, [showing({ drawn })], { refresh_rate_hz: value, device_pixel_ratio: other }))).toBe(true);
      }
  });
});

describe("of a video element", () => {
  const screen = { refresh_rate_hz: 60, device_pixel_ratio: 1 };
  const at = (start: number, hold: number): Showing["drawn"] =>
    Array.from({ length: 30 }, (_, index): [number, number] => [index, index ? start + hold + (index - 1) * 33.33 : start]);

  it("the first frame alone is late where it was held until the clip ran", () => {
    const held = playbackRecord(HASH, [showing({ frames: 30, drawn: at(1010, 60) })], screen);
    expect([held.frames_missing, held.frames_late, held.longest_gap_ms]).toEqual([0, 1, 60]);
  });

  it("frames that were presented without a report are not missing", () => {
    const drawn = at(1010, 40).filter(([index]) => index !== 3);
    const record = playbackRecord(HASH, [showing({ frames: 30, drawn, unlogged: new Map([[4, 1]]) })], screen);
    expect([record.frames_missing, record.longest_gap_ms]).toEqual([0, 40]);
    expect(playbackRecord(HASH, [showing({ frames: 30, drawn })], screen).frames_missing).toBe(1);
  });

  it("nothing is known of the frames where the browser reports none", () => {
    const record = playbackRecord(HASH, [showing({ frames: 30, drawn: [[0, 1010]], logs_frames: false })], screen);
    expect([record.frames_missing, record.frames_late, record.frames_drawn, record.longest_gap_ms]).toEqual([null, null, null, null]);
    expect(record.key_to_first_frame_ms).toBe(10);
  });
});
