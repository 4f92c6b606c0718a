import { describe, expect, it } from "vitest";
import { arrange, topOf } from "../../src/admin/replay/arranging";
import {
  answerWords,
  traceOf,
  folding,
  changeBefore,
  changesOf,
  type Clip,
  nextChange,
  type Play,
  playedBack,
  shownAt,
  type View,
} from "../../src/admin/replay/shown";
import { marksOf } from "../../src/admin/replay/Timeline";
import type { Schemas } from "../../src/admin/api";

const CLIP: Clip = {
  clip_sha256: "ab",
  clip_url: "/clips/ab.mp4",
  cell: "slow",
  exemplar: 1,
  frames: 6,
  fps: 30,
  width_px: 800,
  height_px: 300,
  width_mm: null,
  inter_ocular_px: 400,
};
const LOG: [number, number][] = [
  [0, 20],
  [1, 53],
  [1, 70],
  [4, 453],
  [5, 486],
];

function aView(rest: Partial<View> = {}): View {
  const showing = { roles: ["shown" as const], method: "webcodecs" as const, frames: 6, fps: 30, ended_ms: 520, stalls: 0 };
  return {
    number: 1,
    from_answer: false,
    started_at_client: "2026-11-21T10:00:00.000Z",
    ended_at_client: null,
    outcome: "shown",
    screen: { width_px: 1280, height_px: 720 },
    showings: [{ ...showing, clock_gap_ms: null, clock_late_ms: null, focus_lost: 0, visible_share: 1, refresh_ms: null }],
    clips: [{ role: "shown", clip_sha256: "ab", drawn: LOG }],
    disturbances: {},
    ...rest,
  };
}

function aPlay(rest: Partial<Play> = {}): Play {
  return {
    play: 1,
    px_per_mm: 4,
    views: [aView()],
    answer: null,
    rt: null,
    rt_from_first_frame: null,
    answered_at_client: null,
    comment: null,
    method: null,
    verdict: null,
    verdict_rule: "",
    refresh_rate_hz: 60,
    device_pixel_ratio: 1,
    ...rest,
  };
}

const frameAt = (play: Play, at_ms: number): number | undefined => shownAt(playedBack(play, [CLIP]), at_ms).frames[0]?.frame.index;

describe("what stood on the screen", () => {
  it("is the frame drawn last, until the clip's end", () => {
    const moments = [0, 19.9, 20, 52.9, 53, 452, 453, 486, 519.9, 520, 9_000];
    expect(moments.map((at_ms) => frameAt(aPlay(), at_ms))).toEqual([undefined, undefined, 0, 0, 1, 1, 4, 5, 5, undefined, undefined]);
  });

  it("names frames that were never drawn and those that stood too long", () => {
    const lane = playedBack(aPlay(), [CLIP]).scenes[0]?.lanes[0];
    expect(lane?.missing).toEqual([[2, 3]]);
    expect(lane?.held).toEqual([{ index: 1, from_ms: 53, to_ms: 453 }]);
  });

  it("puts views where their clock says, one after another where it went back", () => {
    const later = aView({ number: 2, started_at_client: "2026-11-21T10:00:03.000Z" });
    const back = aView({ number: 3, started_at_client: "2026-11-21T09:00:00.000Z" });
    const { scenes } = playedBack(aPlay({ views: [aView(), later, back] }), [CLIP]);
    expect(scenes.map(({ start_ms }) => start_ms)).toEqual([0, 3_000, 3_520]);
  });

  it("counts the answer from the clip that was shown last", () => {
    const play = aPlay({ rt_from_first_frame: 1_000, rt: 534, answered_at_client: "2026-11-21T10:00:59.000Z" });
    expect(playedBack(play, [CLIP]).answered_ms).toBe(1_020);
    const untimed = aPlay({ answered_at_client: "2026-11-21T10:00:59.000Z" });
    expect(playedBack(untimed, [CLIP]).answered_ms).toBe(59_000);
    expect(playedBack(aPlay(), [CLIP]).answered_ms).toBeNull();
  });

  it("stops the keys at every change, and at no other moment", () => {
    const changes = changesOf(playedBack(aPlay(), [CLIP]));
    expect(changes).toEqual([0, 20, 53, 453, 486, 520]);
    expect([nextChange(changes, 20), nextChange(changes, 520), changeBefore(changes, 20), changeBefore(changes, 0)]).toEqual([
      53, 520, 0, 0,
    ]);
  });

  it("of a view that was broken off is nothing", () => {
    const play = aPlay({ views: [aView({ clips: [], showings: null, outcome: "interrupted" })] });
    expect(playedBack(play, [CLIP])).toMatchObject({ end_ms: 0, scenes: [{ lanes: [] }] });
    expect(shownAt(playedBack(play, [CLIP]), 0).frames).toEqual([]);
  });
});

describe("a folded time line", () => {
  const time = folding(
    [
      { start_ms: 0, end_ms: 1_000 },
      { start_ms: 2_000, end_ms: 3_000 },
    ],
    63_000,
  );
  it("shortens long waits alone", () => {
    expect([time.fold(500), time.fold(2_000), time.fold(3_000), time.length_ms]).toEqual([500, 2_000, 3_000, 4_500]);
  });
  it("leads back to every moment", () => {
    for (let real = 0; real <= 63_000; real += 37) expect(time.unfold(time.fold(real))).toBeCloseTo(real, 6);
  });
  it("of nothing has no length", () => {
    expect(folding([], 0).length_ms).toBe(0);
  });
});

describe("the size of a clip there", () => {
  const display = { inter_ocular_mm: 60 } as Schemas["Display"];
  const rating = { kind: "clip_rating" } as Schemas["Replay"]["trial"];
  it("is that of its calibration", () => {
    expect(arrange({ trial: rating, display }, [CLIP], aPlay())?.shown).toEqual({ width: 480, height: 180 });
    expect(arrange({ trial: rating, display }, [], aPlay())).toBeNull();
  });
  it("of a pair is that of the arrangement that was taken", () => {
    const presentation = { arrangement: "side_by_side", gap_mm: 10, if_too_narrow: "stack" };
    const trial = { kind: "paired_comparison", presentation } as Schemas["Replay"]["trial"];
    const clips = ["left", "right"].map((role) => ({ role, clip_sha256: "ab", drawn: LOG })) as View["clips"];
    const views = [aView({ clips })];
    const sideBySide = arrange({ trial, display }, [CLIP], aPlay({ views }));
    expect(sideBySide?.boxOf("right")).toMatchObject({ x: 800 + Math.round(40 * (800 / 480)), y: 0 });
    const stacked = arrange({ trial, display }, [CLIP], aPlay({ views, answer: { arrangement: "stacked" } }));
    expect(stacked?.boxOf("right")).toMatchObject({ x: 0, y: 300 + Math.round(40 * (800 / 480)) });
  });
  it("leaves the room below that the page gives to the answer", () => {
    expect(topOf(720, 180)).toBeCloseTo(540 / 2.35, 6);
    expect(topOf(400, 180)).toBe(12);
  });
});

describe("an answer in words", () => {
  it("is said for every kind", () => {
    const said = (answer: Play["answer"]): string => answerWords(aPlay({ answer }));
    expect(said(null)).toBe("no answer");
    expect(said({ kind: "clip_rating", response: 5 })).toBe("response 5");
    const answers = { calm: { response: 3 }, odd: { response: null, not_applicable: true } };
    expect(said({ kind: "clip_rating", answers })).toBe("calm 3, odd not applicable");
    expect(said({ kind: "paired_comparison", winner: "left", arrangement: "side_by_side" })).toBe("winner left, arrangement side by side");
    expect(said({ kind: "continuous_rating", values: [1, 2], step_frames: 3, moves: 2, chosen: null })).toBe(
      "2 samples of the slider, step frames 3, moves 2",
    );
    expect(said({ kind: "threshold", chosen: "yes", known: 4 })).toBe("chosen yes, stimulus chosen by 4 answers before");
    expect(said({ kind: "threshold", chosen: "second", known: 1 })).toBe("chosen second, stimulus chosen by 1 answer before");
    expect(said({ kind: "check", check: 2, other_way: false })).toBe("check 2");
    expect(said({ kind: "check", check: null, other_way: true })).toBe("other way");
  });
  it("of a trial that could not be shown is none", () => {
    const said = (answer: Play["answer"]): string => answerWords(aPlay({ answer }));
    expect(said({ kind: "threshold", chosen: null, known: 0 })).toBe("no answer");
    expect(said({ kind: "check", check: null, other_way: false })).toBe("no answer");
    expect(said({ kind: "paired_comparison", winner: null, arrangement: "stacked" })).toBe("no answer");
    expect(said({ kind: "continuous_rating", values: null, step_frames: null, moves: 0, chosen: null, response: null })).toBe("no answer");
  });
});

describe("the marks on a time line", () => {
  const event = (type: string, at_client: string) => ({ type, at_client }) as Schemas["ReplayedEvent"];
  const events = [event("focus_lost", "2026-11-21T10:00:02.000Z"), event("focus_lost", "2026-11-21T09:59:59.000Z")];
  it("are events since the start key and the answer, in the order of time", () => {
    const play = aPlay({ rt_from_first_frame: 1_000 });
    const marks = marksOf(play, playedBack(play, [CLIP]), events);
    expect(marks.map(({ at_ms, label }) => [at_ms, label])).toEqual([
      [1_020, "answer"],
      [2_000, "focus lost"],
    ]);
  });
  it("of a play without views are none: there is nothing to count from", () => {
    const play = aPlay({ views: [] });
    expect(marksOf(play, playedBack(play, []), events)).toEqual([]);
  });
});

describe("the slider over a time line", () => {
  const trial = { kind: "continuous_rating", minimum: -1, maximum: 1 } as Schemas["Replay"]["trial"];
  const answer = { kind: "continuous_rating", values: [-1, 0, null, 1], step_frames: 1 };
  it("is at the sampled frame, or at the next one that was drawn", () => {
    const play = aPlay({ answer });
    expect(traceOf(play, playedBack(play, [CLIP]), trial)).toEqual([
      [20, 0],
      [53, 0.5],
      [453, 1],
    ]);
  });
  it("ends with the frames that were drawn", () => {
    const play = aPlay({ answer: { ...answer, values: [0, 0, 0, 0], step_frames: 3 } });
    expect(traceOf(play, playedBack(play, [CLIP]), trial)).toEqual([
      [20, 0.5],
      [453, 0.5],
    ]);
  });
  it("of other kinds, and without an answer, is nothing", () => {
    const rated = aPlay({ answer: { kind: "clip_rating", response: 3 } });
    expect(traceOf(rated, playedBack(rated, [CLIP]), { kind: "clip_rating" } as Schemas["Replay"]["trial"])).toEqual([]);
    expect(traceOf(aPlay(), playedBack(aPlay(), [CLIP]), trial)).toEqual([]);
  });
});
