import { describe, expect, it } from "vitest";
import { playbackRecord, type Showing, FrameSchedule } from "../../src/participant/playback/record";

const PERIOD = 1000 / 30;

/** Indices drawn when refreshes come at `ticks`. */
function drawnAt(ticks: number[], frames: number, refresh_ms: number): number[] {
  const schedule = new FrameSchedule(frames, PERIOD, refresh_ms);
  return ticks.map((now) => schedule.next(now)).filter((index): index is number => index !== null);
}
const refreshes = (rate: number, seconds: number, jitter = (): number => 0): number[] =>
  Array.from({ length: Math.round(rate * seconds) }, (_, n) => 100 + (n * 1000) / rate + jitter());
const all = (frames: number): number[] => Array.from({ length: frames }, (_, n) => n);

describe("frame schedule", () => {
  it.each([50, 60, 75, 90, 120, 144, 165, 240])("draws every frame once and in order at %i Hz, jitter or not", (rate) => {
    let seed = rate;
    const jitter = (): number => ((seed = (seed * 16_807) % 2_147_483_647) / 2_147_483_647 - 0.5) * 3;
    expect(drawnAt(refreshes(rate, 1.6), 45, 1000 / rate)).toEqual(all(45));
    expect(drawnAt(refreshes(rate, 1.6, jitter), 45, 1000 / rate)).toEqual(all(45));
  });

  it("goes on at the frame that is due after a hold-up, and is in time from there", () => {
    const schedule = new FrameSchedule(60, 1000 / 60, 1000 / 60);
    const ticks = refreshes(60, 1).filter((_, n) => n !== 20 && n !== 21);
    const drawn = ticks.map((now) => schedule.next(now));
    expect(drawn).toEqual(all(60).filter((n) => n !== 20 && n !== 21));
  });

  it("loses no frame to a hold-up shorter than a frame", () => {
    const ticks = refreshes(60, 1.6).filter((_, n) => n !== 20);
    expect(drawnAt(ticks, 45, 1000 / 60)).toEqual(all(45));
  });

  it.each([58.6, 59, 59.94, 60.5, 61])("gives each frame of 60 fps one refresh of %f Hz", (rate) => {
    const schedule = new FrameSchedule(60, 1000 / 60, 1000 / rate);
    const drawn = refreshes(rate, 60 / rate).map((now) => schedule.next(now));
    expect(drawn).toEqual(all(60));
  });

  it.each([58.6, 59, 61])("loses none at %f Hz where 60 Hz are taken for granted, as before the screen is measured", (rate) => {
    const schedule = new FrameSchedule(60, 1000 / 60, 1000 / 60);
    const drawn = refreshes(rate, 60 / rate).map((now) => schedule.next(now));
    expect(drawn).toEqual(all(60));
    expect(schedule.isOver(100 + (60 * 1000) / rate)).toBe(true);
  });

  it("is over one period after the last frame", () => {
    const schedule = new FrameSchedule(2, PERIOD, 1000 / 60);
    [0, PERIOD].forEach((now) => schedule.next(now));
    expect([PERIOD, 1.5 * PERIOD - 1, 2 * PERIOD].map((now) => schedule.isOver(now))).toEqual([false, false, true]);
  });
});

describe("playback record", () => {
  const showing = (drawn: [number, number][], rest: Partial<Showing> = {}): Showing => ({
    method: "webcodecs",
    key_at_ms: 1_000,
    ended_at_ms: 2_000,
    drawn,
    frames: 3,
    fps: 30,
    stalls: 0,
    focus_lost: 0,
    disturbances: {},
    visible_share: 1,
    refresh_ms: 16.7,
    clock_gap_ms: 17,
    clock_late_ms: 1,
    ...rest,
  });
  const screen = { refresh_rate_hz: 60, device_pixel_ratio: 2 };

  it("counts a clean play", () => {
    const record = playbackRecord(
      "ab",
      [
        showing([
          [0, 1_010],
          [1, 1_043.4],
          [2, 1_076.7],
        ]),
      ],
      screen,
    );
    expect(record).toMatchObject({
      method: "webcodecs",
      key_to_first_frame_ms: 10,
      frames_drawn: 3,
      frames_late: 0,
      frames_missing: 0,
      longest_gap_ms: 33.4,
    });
    expect(record.drawn).toEqual([
      [0, 10],
      [1, 43.4],
      [2, 76.7],
    ]);
  });

  it("counts what is missing and late", () => {
    const record = playbackRecord(
      "ab",
      [
        showing([
          [0, 1_010],
          [2, 1_110],
        ]),
      ],
      screen,
    );
    expect(record).toMatchObject({ frames_drawn: 2, frames_missing: 1, frames_late: 1, longest_gap_ms: 100 });
  });

  it.each([59, 59.94, 60])("calls no frame late that had its refresh of %f Hz where the rate was not measured", (rate) => {
    const drawn = all(120).map((index): [number, number] => [index, 1_010 + (index * 1000) / rate]);
    const play = showing(drawn, { frames: 120, fps: 60, refresh_ms: 1000 / rate });
    const record = playbackRecord("ab", [play], { ...screen, refresh_rate_hz: null });
    expect(record).toMatchObject({ frames_late: 0, frames_missing: 0, refresh_rate_hz: null });
  });

  it("counts frames as late by the screen's refresh where a loaded page saw fewer of them", () => {
    const drawn = all(60).map((index): [number, number] => [index, 1_010 + (index * 1000) / 30 + (index > 30 ? 25 : 0)]);
    const record = playbackRecord("ab", [showing(drawn, { frames: 60, refresh_ms: 1000 / 30 })], screen);
    expect(record.frames_late).toBe(29);
  });

  it("reports the rate of the screen that showed it, if that is faster than was measured", () => {
    const drawn = all(3).map((index): [number, number] => [index, 1_010 + index * 33.3]);
    const rateOf = (...seen_ms: (number | null)[]): number | null =>
      playbackRecord(
        "ab",
        seen_ms.map((refresh_ms) => showing(drawn, { refresh_ms })),
        screen,
      ).refresh_rate_hz;
    expect([rateOf(1000 / 144), rateOf(16.7), rateOf(33.3), rateOf(null), rateOf(16.7, 1000 / 120)]).toEqual([144, 60, 60, 60, 120]);
  });

  it("adds up the views of a trial, the worst method counting", () => {
    const views = [
      showing([
        [0, 1_010],
        [1, 1_043],
        [2, 1_077],
      ]),
      showing([[0, 5_005]], { key_at_ms: 5_000, method: "video", focus_lost: 2 }),
    ];
    const record = playbackRecord("ab", views, screen);
    expect(record).toMatchObject({ method: "video", frames_drawn: 4, frames_missing: 2, focus_lost: 2 });
    expect(record.drawn.at(-1)).toEqual([0, 5]);
  });

  it("claims nothing where nothing was shown", () => {
    expect(playbackRecord(null, [], screen)).toMatchObject({
      method: "none",
      key_to_first_frame_ms: null,
      longest_gap_ms: null,
      drawn: [],
    });
  });
});
