import { afterEach, describe, expect, it, vi } from "vitest";
import type { Gates } from "../../src/api/schema";
import { aTrial } from "./a-trial";
import { luminance } from "../../src/participant/flow/start-page";
import { findings, lackOfRoom, type Abilities, type Measures } from "../../src/participant/flow/gates";
import { owed, Replays, done, type Session } from "../../src/participant/session";
import { refreshRate, untilMeasured } from "../../src/participant/screen/window";
import { clipHeight, clipWidth, screenChange, zoomed, isPlausible, type ScreenShape } from "../../src/participant/screen/size";
import { deviation, randomStart, settled, spreadPercent, distanceFrom } from "../../src/participant/calibration/distance";
import { keyFor, valueOf } from "../../src/participant/trials/scales/points";
import { clipSize } from "../../src/participant/trials/showing";

describe("actual size", () => {
  it("shows the inter-ocular distance as declared", () => {
    const width = clipWidth(aTrial(), 60, 4);
    expect((width / 800) * 400).toBeCloseTo(60 * 4);
    expect(clipHeight(aTrial(), width)).toBeCloseTo((width * 300) / 800);
  });
  it("falls back to the clip's width in mm, then to its own pixels", () => {
    expect(clipWidth(aTrial({ inter_ocular_px: null }), 60, 4)).toBe(520);
    expect(clipWidth(aTrial({ inter_ocular_px: null, width_mm: null }), 60, 4)).toBe(800);
    expect(clipWidth(aTrial(), 60, null)).toBe(800);
  });

  describe("in a window", () => {
    afterEach(() => vi.unstubAllGlobals());
    const width = (px_per_mm: number | null, innerWidth: number): number => {
      vi.stubGlobal("window", { innerWidth });
      return clipSize({ run: { display: { inter_ocular_mm: 60 } }, screen: { px_per_mm } } as unknown as Session, aTrial()).width;
    };
    it("is kept once it was measured, so that a narrower one is seen to cut the clip off", () => {
      expect([width(4, 1_280), width(4, 390)]).toEqual([480, 480]);
    });
    it("gives way to the window where nothing was measured", () => {
      expect([width(null, 390), width(null, 1_280)]).toEqual([390, 800]);
    });
  });

  const before: ScreenShape = { device_pixel_ratio: 1, screen_width_px: 1_920, screen_height_px: 1_080 };
  it.each([
    ["nothing", {}, "none"],
    ["Chromium's zoom", { device_pixel_ratio: 1.5 }, "zoom"],
    ["Firefox's zoom", { device_pixel_ratio: 1.5, screen_width_px: 1_280, screen_height_px: 720 }, "zoom"],
    ["a tablet turned", { screen_width_px: 1_080, screen_height_px: 1_920 }, "none"],
    ["another monitor", { screen_width_px: 2_560, screen_height_px: 1_440 }, "screen"],
    ["a finer monitor", { device_pixel_ratio: 2, screen_width_px: 1_512, screen_height_px: 982 }, "screen"],
  ])("recognizes %s", (_what, change, kind) => {
    expect(screenChange(before, { ...before, ...change })).toBe(kind);
  });
  it("keeps the size in millimetres under zoom", () => {
    expect(zoomed(4, before, { ...before, device_pixel_ratio: 2 })).toBe(2);
  });
  it("takes the blind spot at 13.5 degrees", () => {
    expect(distanceFrom(144 * 4, 4)).toBeCloseTo(599.8, 0);
  });
  it("reads the refresh rate from the median interval", () => {
    const stamps = Array.from({ length: 61 }, (_, n) => (n * 1000) / 144 + (n === 30 ? 4 : 0));
    expect(refreshRate(stamps)).toBeCloseTo(144, 0);
    expect(refreshRate([1, 2, 3])).toBeNull();
  });
  it.each([59.94, 75, 120, 144, 165, 240, 300, 360, 480])(
    "reads a rate of %f Hz from stamps rounded to a millisecond, a refresh missed now and then",
    (rate) => {
      const seen = Array.from({ length: 64 }, (_, n) => n).filter((n) => n !== 20 && n !== 41);
      for (const round of [Math.floor, Math.round]) {
        const stamps = seen.map((n) => 1_764_000_000_000.123 + round(7.4 + (n * 1000) / rate));
        expect(Math.abs((refreshRate(stamps) ?? 0) / rate - 1)).toBeLessThan(0.02);
      }
    },
  );
});

describe("the refresh rate of a page that nobody looked at", () => {
  it("is measured again each time the page is looked at, until it is known or the run is over", async () => {
    const page = Object.assign(new EventTarget(), { visibilityState: "visible" });
    const look = async (state: string): Promise<void> => {
      page.visibilityState = state;
      page.dispatchEvent(new Event("visibilitychange"));
      await Promise.resolve();
    };
    const rates = [null, null, 59.9, 120];
    const reported: (number | null)[] = [];
    const over = new AbortController();
    const measure = (): Promise<number | null> => Promise.resolve(rates.shift() ?? null);
    const measured = untilMeasured(page as unknown as Document, (rate) => reported.push(rate), over.signal, measure);
    for (const state of ["hidden", "visible", "hidden", "visible", "visible", "hidden", "visible"]) {
      await new Promise((resolve) => setTimeout(resolve));
      await look(state);
    }
    await measured;
    expect([reported, rates]).toEqual([[null, null, 59.9], [120]]);
  });

  it("stays unknown where the run is over before that", async () => {
    const over = new AbortController();
    const reported: (number | null)[] = [];
    const measured = untilMeasured(
      new EventTarget() as Document,
      (rate) => reported.push(rate),
      over.signal,
      () => Promise.resolve(null),
    );
    over.abort();
    await measured;
    expect(reported).toEqual([]);
  });
});

describe("gates", () => {
  const fine: Abilities = {
    secure: true,
    web_codecs: true,
    video: true,
    h264: true,
    storage: true,
    touch_only: false,
    screen_width_px: 1_440,
    screen_height_px: 900,
  };
  const gates = {
    minimum_width_px: 800,
    minimum_height_px: 500,
    allow_touch: true,
    full_screen: true,
    calibrate: "required" as const,
    viewing_distance: false,
    inter_ocular_mm: 60,
  };
  it.each([
    [{}, []],
    [{ secure: false }, ["gate_insecure"]],
    [{ web_codecs: false }, ["gate_video"]],
    [{ web_codecs: false, video: false }, ["gate_browser"]],
    [{ h264: false }, ["gate_h264"]],
    [{ storage: false }, ["gate_storage"]],
    [{ screen_width_px: 390, screen_height_px: 844 }, ["gate_screen"]],
    [{ screen_width_px: 768, screen_height_px: 1_024 }, []],
  ])("finds %o", (change, reasons) => {
    expect(findings({ ...fine, ...change }, gates).map((finding) => finding.reason)).toEqual(reasons);
  });
  it("asks for a keyboard where touch is not allowed", () => {
    expect(findings({ ...fine, touch_only: true }, { ...gates, allow_touch: false })[0]).toMatchObject({
      reason: "gate_touch",
      closed: true,
    });
  });
});

describe("repetitions", () => {
  it("come once each, at the end of their block or of a later one", () => {
    const replays = new Replays();
    replays.add(aTrial({ trial_index: 4, block: 2 }), 2);
    replays.add(aTrial({ trial_index: 4, block: 2 }), 2);
    expect(replays.peek(1)).toBeNull();
    expect(replays.peek(3)?.trial.trial_index).toBe(4);
    replays.shift(3);
    expect(replays.peek(3)).toBeNull();
  });
  it("are dropped, that play alone, where they were begun and broken off", () => {
    const replays = new Replays();
    const trial = aTrial({ trial_index: 4, block: 2 });
    replays.add(trial, 2);
    replays.add(trial, 3);
    replays.drop(trial, 2);
    expect(replays.peek(3)?.play).toBe(3);
  });
  it("leave their trials undone", () => {
    const [interrupted, answered] = [aTrial({ plays_done: 1, answered: true }), aTrial({ trial_index: 1, plays_done: 1, answered: true })];
    const run = {
      trials: [interrupted, answered, aTrial({ trial_index: 2 }), aTrial({ trial_index: 3, kind: "practice", answered: true })],
    };
    expect(done(run)).toHaveLength(2);
    new Replays().add(interrupted, 2);
    expect(done(run)).toEqual([answered]);
    expect(done({ trials: [aTrial({ plays_done: 1, plays_wanted: 2, answered: true })] })).toEqual([]);
  });
  it("are owed where an earlier visit stopped before them", () => {
    expect(owed([aTrial(), aTrial({ plays_done: 1, plays_wanted: 2 }), aTrial({ plays_done: 1 })])).toMatchObject([{ play: 2 }]);
  });
});

describe("keys of the scale", () => {
  it.each([
    ["1", 1, 7, 1],
    ["7", 1, 7, 7],
    ["8", 1, 7, null],
    ["0", 1, 7, null],
    ["0", 0, 10, 0],
    ["0", 1, 10, 10],
    ["a", 1, 7, null],
  ])("%s on a scale from %i to %i", (key, minimum, maximum, value) => {
    expect(valueOf(key, { minimum, maximum })).toBe(value);
  });
  it("follow the direction of reading", () => {
    expect([keyFor("ArrowRight", false), keyFor("ArrowRight", true), keyFor("x", false)]).toEqual([1, -1, 0]);
  });
});

it("ink on the surround is chosen by luminance", () => {
  expect(luminance("#808080")).toBeCloseTo(0.2159, 3);
  expect(luminance("#ffffff")).toBeCloseTo(1);
});

it("digits of an Arabic keyboard answer as the others do", () => {
  expect(["٤", "4", "٠", "٨", "ب"].map((key) => valueOf(key, { minimum: 1, maximum: 7 }))).toEqual([4, 4, null, null, null]);
});

describe("repeated measurements", () => {
  it("count where they agree, else are followed by one more, at most two", () => {
    expect(settled([3.7], 2)).toBeNull();
    expect(settled([3.7, 3.75], 2)).toEqual([3.7, 3.75]);
    expect(settled([3.7, 4.1], 2)).toBeNull();
    expect(settled([3.7, 4.1, 4.12], 2)).toEqual([4.1, 4.12]);
    expect(settled([3.7, 4.1, 3.7, 4.1], 2)).toEqual([3.7, 4.1]);
  });
  it("have a spread in percent of their mean, and a standard deviation", () => {
    expect(spreadPercent([95, 105])).toBeCloseTo(10);
    expect(deviation([600, 610, 620])).toBeCloseTo(10);
    expect(deviation([600])).toBe(0);
  });
  it("begin anywhere but where the last one ended", () => {
    const starts = Array.from({ length: 500 }, () => randomStart(180, 510, 324));
    expect(Math.min(...starts.map((start) => Math.abs(start - 324)))).toBeGreaterThan(32);
    expect(Math.min(...starts)).toBeGreaterThanOrEqual(180);
    expect(Math.max(...starts)).toBeLessThanOrEqual(510);
    expect(new Set(starts).size).toBeGreaterThan(400);
  });
});

describe("room for the clips before anything has begun", () => {
  const gates = { minimum_width_px: 800, minimum_height_px: 500 } as Gates;
  const window = { inner: [1_280, 700], outer: [1_280, 760], screen: [1_280, 800], full_screen: false } satisfies Measures;
  it("is there, or the window is too small, or the page is enlarged", () => {
    expect(lackOfRoom(gates, window)).toBeNull();
    expect(lackOfRoom(gates, { ...window, inner: [700, 600], outer: [700, 660] })?.reason).toBe("window_small");
    expect(lackOfRoom(gates, { ...window, inner: [640, 350] })?.reason).toBe("gate_zoom");
  });
  it("is the screen's where the page will fill it, in enlarged pixels", () => {
    expect(lackOfRoom(gates, { ...window, inner: [700, 400], outer: [700, 460], full_screen: true })).toBeNull();
    const lack = lackOfRoom(gates, { ...window, inner: [640, 350], full_screen: true });
    expect([lack?.reason, lack?.values["have_width"]]).toEqual(["gate_zoom", 640]);
  });
});

describe("plausible sizes", () => {
  it("a screen more than a metre wide is none, but for one twice as wide as high", () => {
    const wide = { device_pixel_ratio: 1, screen_width_px: 5_120, screen_height_px: 1_440 };
    expect(isPlausible(5_120 / 1_190, wide)).toBe(true);
    expect(isPlausible(2_560 / 1_030, { ...wide, screen_width_px: 2_560 })).toBe(false);
  });
  it.each([
    [1_280 / 1_030, false],
    [1_920 / 1_030, false],
    [96 / 25.4, true],
    [160 / 25.4, true],
    [1_920 / 24, false],
  ])("%f px/mm: %s", (px_per_mm, plausible) => {
    expect(isPlausible(px_per_mm, { device_pixel_ratio: 1, screen_width_px: 1_280, screen_height_px: 720 })).toBe(plausible);
  });
});
