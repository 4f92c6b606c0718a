import { afterEach, describe, expect, it, vi } from "vitest";
import type { TrialInfo } from "../../src/api/schema";
import { composition, drawFrame, framesOf } from "../../src/participant/playback/compose";
import type { DecodedClip } from "../../src/participant/playback/decode";
import { winnerOf } from "../../src/participant/kinds/paired_comparison/answer";
import { clipsOf } from "../../src/participant/trials/in-turn";
import { layoutOf, roomNeeded } from "../../src/participant/kinds/paired_comparison/layout";
import { stageFor } from "../../src/participant/kinds/paired_comparison/screen";
import type { Session } from "../../src/participant/session";
import { showStage, type Stage } from "../../src/participant/trials/showing";
import { aTrial } from "./a-trial";

vi.mock("jspsych", () => ({ initJsPsych: vi.fn(), ParameterType: {} }));
vi.mock("../../src/participant/screens/screen-setup", () => ({ askRoom: vi.fn() }));
vi.mock(import("../../src/participant/trials/showing"), async (load) => ({ ...(await load()), showStage: vi.fn() }));

const SIDE_BY_SIDE = { arrangement: "side_by_side", gap_mm: 10, if_too_narrow: "stack" } as const;
const PIXELS = { width: 960, height: 360 };
const SHOWN = { width: 480, height: 180 };

describe("layout of a pair", () => {
  it("puts two clips side by side at their own size, with the gap in millimeters", () => {
    const layout = layoutOf(SIDE_BY_SIDE, PIXELS, SHOWN, { width: 1440, height: 900 }, 4);
    expect(layout?.canvas).toEqual({ width: 2 * 960 + 80, height: 360 });
    expect(layout?.shown).toEqual({ width: 1000, height: 180 });
    expect(layout?.boxes.map(({ x, y, width, height }) => [x, y, width, height])).toEqual([
      [0, 0, 960, 360],
      [1040, 0, 960, 360],
    ]);
    expect(layout?.single.x).toBe(520);
  });

  it("stacks them on a narrow screen only where that is declared", () => {
    const narrow = { width: 900, height: 900 };
    expect(layoutOf(SIDE_BY_SIDE, PIXELS, SHOWN, narrow, 4)?.arrangement).toBe("stacked");
    expect(layoutOf({ ...SIDE_BY_SIDE, if_too_narrow: "refuse" }, PIXELS, SHOWN, narrow, 4)).toBeNull();
    expect(layoutOf(SIDE_BY_SIDE, PIXELS, SHOWN, { width: 900, height: 500 }, 4)).toBeNull();
    expect(roomNeeded(SIDE_BY_SIDE, SHOWN, 4).width).toBe(1000);
  });

  it("has one place for two clips in turn", () => {
    const layout = layoutOf({ arrangement: "one_after_the_other", gap_ms: 300 }, PIXELS, SHOWN, SHOWN, null);
    expect(layout?.boxes[0]).toEqual(layout?.boxes[1]);
    expect(layout?.canvas).toEqual(PIXELS);
  });
});

describe("place of a pair in a window that is made narrower", () => {
  afterEach(() => vi.unstubAllGlobals());
  const widths = async (px_per_mm: number | null): Promise<number[]> => {
    const sizes: (() => { width: number; height: number })[] = [];
    vi.mocked(showStage).mockImplementation((_session, _display, size) => {
      sizes.push(size);
      return {} as Stage;
    });
    const window = { innerWidth: 1_800, innerHeight: 900 };
    vi.stubGlobal("window", window);
    const declared = { kind: "paired_comparison", presentation: SIDE_BY_SIDE };
    const run = { display: { inter_ocular_mm: 60 }, trial: declared };
    await stageFor({ run, screen: { px_per_mm } } as unknown as Session, {} as HTMLElement, aTrial());
    const before = sizes[0]?.();
    window.innerWidth = 400;
    const after = sizes[0]?.();
    expect((after?.width ?? 0) / (after?.height ?? 0)).toBeCloseTo((before?.width ?? 0) / (before?.height ?? 0));
    return [before?.width ?? 0, after?.width ?? 0].map(Math.round);
  };
  it("gives way to it as a single clip does, where nothing was measured", async () => {
    expect(await widths(null)).toEqual([2 * 800 + 38, 400]);
  });
  it("is kept at actual size", async () => {
    expect(await widths(4)).toEqual([2 * 480 + 40, 2 * 480 + 40]);
  });
});

describe("answers to a pair", () => {
  it("are given by arrows and numbers, a tie only where there is one", () => {
    expect(["ArrowLeft", "1", "ArrowRight", "2"].map((key) => winnerOf(key, false))).toEqual(["left", "left", "right", "right"]);
    expect(["3", "T", "0"].map((key) => winnerOf(key, true))).toEqual(["tie", "tie", "tie"]);
    expect(["3", "t", "0", "x", "toString"].map((key) => winnerOf(key, false))).toEqual([null, null, null, null, null]);
  });
});

describe("one clock for two clips", () => {
  const clip = (name: string, frames: number, fps = 30): DecodedClip => ({
    bitmaps: Array.from({ length: frames }, (_, index) => ({ name: `${name}${index}` }) as unknown as ImageBitmap),
    fps,
    width: 10,
    height: 5,
  });
  const clips = new Map([
    ["a", clip("a", 3)],
    ["b", clip("b", 2)],
    ["c", clip("c", 3, 60)],
  ]);
  const at = (sha256: string, x: number) => ({ sha256, x, y: 0, width: 10, height: 5 });

  it("draws the same frame of each in one call; the shorter holds its last", () => {
    const pair = composition([at("a", 0), at("b", 12)], (name) => clips.get(name), 22, 5);
    const drawn: unknown[] = [];
    const canvas = {
      canvas: { width: 22, height: 5 },
      drawImage: (image: unknown, x: number) => drawn.push([(image as { name: string }).name, x]),
    };
    expect(framesOf(pair)).toBe(3);
    for (let index = 0; index < 3; index += 1) expect(drawFrame(canvas, pair, index)).toBe(true);
    expect(drawn).toEqual([
      ["a0", 0],
      ["b0", 12],
      ["a1", 0],
      ["b1", 12],
      ["a2", 0],
      ["b1", 12],
    ]);
  });

  it("refuses clips of two frame rates, and one that is not there", () => {
    expect(() => composition([at("a", 0), at("c", 12)], (name) => clips.get(name), 22, 5)).toThrow("one frame rate, got 30 and 60");
    expect(() => composition([at("a", 0), at("z", 12)], (name) => clips.get(name), 22, 5)).toThrow("expected decoded clips");
  });
});

describe("what is sent of a pair", () => {
  const clip = { fps: 30 };
  const trial = {
    clips: [
      { ...clip, role: "left", clip_sha256: "aa", frames: 3 },
      { ...clip, role: "right", clip_sha256: "bb", frames: 2 },
    ],
  } as unknown as TrialInfo;
  const showing = {
    method: "webcodecs" as const,
    key_at_ms: 100,
    ended_at_ms: 220,
    drawn: [
      [0, 110],
      [2, 177],
    ] as [number, number][],
    frames: 3,
    fps: 30,
    stalls: 0,
    clock_gap_ms: null,
    clock_late_ms: null,
    focus_lost: 0,
    early_keys: 0,
    disturbances: {},
    visible_share: 1,
    refresh_ms: null,
  };
  const shown = [{ roles: ["left", "right"], showing }];

  it("counts each clip's own frames from the one log", () => {
    expect(clipsOf(trial, shown)).toEqual({
      left: { clip_sha256: "aa", frames_drawn: 2, frames_missing: 1 },
      right: { clip_sha256: "bb", frames_drawn: 2, frames_missing: 0 },
    });
  });
});
