/** Adaptive series on the page: keys, choices that come late, trials of ended series. */
import { describe, expect, test, vi } from "vitest";
import type { TrialInfo } from "../../src/api/schema";
import { responseOf, behind } from "../../src/participant/kinds/threshold/answer";
import { applyNext, begin } from "../../src/participant/session";
vi.mock("jspsych", () => ({ initJsPsych: vi.fn(), ParameterType: {} }));

function trial(trial_index: number, known: number, clip = "a"): TrialInfo {
  const clips = [{ role: "shown", clip_sha256: clip }];
  const series = { number: 0, position: trial_index + 1, known };
  return {
    trial_index,
    kind: "main",
    clip_sha256: clip,
    clips,
    series,
    plays_done: 0,
    plays_wanted: 1,
    answered: false,
  } as unknown as TrialInfo;
}

describe("answers by key", () => {
  test("arrows and numbers name the buttons, Y and N the words", () => {
    expect(["1", "ArrowLeft", "y"].map((key) => responseOf(key, ["yes", "no"]))).toEqual(["yes", "yes", "yes"]);
    expect(["2", "ArrowRight", "n"].map((key) => responseOf(key, ["yes", "no"]))).toEqual(["no", "no", "no"]);
    expect(["1", "2", "y", "3", " "].map((key) => responseOf(key, ["first", "second"]))).toEqual(["first", "second", null, null, null]);
  });
});

describe("choices of the server", () => {
  test("take the place of trials that have not begun", () => {
    const trials = [trial(0, 0), trial(1, 0), trial(2, 0)];
    begin(trials[1] as TrialInfo);
    const changed = applyNext(trials, { trials: [trial(1, 1, "b"), trial(2, 1, "c")], closed: [] });
    expect(trials.map((one) => one.clip_sha256)).toEqual(["a", "a", "c"]);
    expect(changed.map((one) => one.trial_index)).toEqual([2]);
  });

  test("that know less than those that are here are too late", () => {
    const trials = [trial(0, 3, "new")];
    expect(applyNext(trials, { trials: [trial(0, 2, "old")], closed: [] })).toEqual([]);
    expect(trials[0]?.clip_sha256).toBe("new");
  });

  test("close what an ended series leaves over, but nothing that was shown", () => {
    const shown = { ...trial(0, 0), plays_done: 1, answered: true, plays_wanted: 2 };
    const trials = [shown, trial(1, 0)];
    applyNext(trials, { trials: [], closed: [0, 1] });
    expect(trials.map((one) => [one.answered, one.plays_wanted])).toEqual([
      [true, 2],
      [true, 0],
    ]);
  });
});

test("a trial is behind by the answers that its choice did not know", () => {
  expect(behind(trial(4, 4))).toBe(0);
  expect(behind(trial(4, 1))).toBe(3);
  expect(behind({ ...trial(0, 0), series: null })).toBe(0);
});
