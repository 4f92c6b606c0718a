import { describe, expect, it } from "vitest";
import { briefChanges, candidateFrames, farthestPictures, chooseFrames } from "../../src/labelling/labelled-frames";
import { NO_EYES } from "../../src/labelling/eyes";
import type { Grey } from "../../src/labelling/grey";
import {
  begun,
  changed,
  redone,
  undone,
  atFrame,
  atNeighbour,
  labelFileOf,
  NO_WORK,
  withAccepted,
  withEyes,
  withLabels,
  withMove,
  withoutCurrent,
  withRedo,
  withUndo,
  withVideo,
  type Work,
} from "../../src/labelling/work";
import { checkShape, labelsText, parseLabels } from "../../src/labelling/label-file";
import { at, nearestPoint, type Point, type Shape, templateShape, withEyeStretched, withPoint } from "../../src/labelling/points";
import { proposeShape } from "../../src/labelling/propose";
import {
  decide,
  decisionOn,
  edgeLimits,
  edgesOf,
  parseBlinks,
  parseReview,
  reviewText,
  withDecision,
  withEdge,
  traceOf,
  tracePath,
  zoomedWindow,
} from "../../src/labelling/review";
import { parseTable } from "../../src/labelling/csv";

const SIZE = [640, 480] as const;
const flat = (value: number): Grey => ({ width: 4, height: 4, values: new Uint8ClampedArray(16).fill(value) });

describe("frames to label", () => {
  it("are spread over the video, at most so many", () => {
    expect(candidateFrames(5)).toEqual([0, 1, 2, 3, 4]);
    expect(candidateFrames(239).slice(-2)).toEqual([236, 238]);
    expect(candidateFrames(360)).toHaveLength(121);
    expect(candidateFrames(100_000)).toHaveLength(1_200);
    expect(candidateFrames(100_000).at(-1)).toBe(99_999);
    expect(candidateFrames(1)).toEqual([0]);
    expect(candidateFrames(0)).toEqual([]);
  });
  it("of a minute leave no three frames out, which a closed lid stays", () => {
    const numbers = candidateFrames(1_800);
    expect(Math.max(...numbers.slice(1).map((number, index) => number - (numbers[index] ?? 0)))).toBe(3);
  });
  it("hold the blinks of a minute, though the light changes more than they do", () => {
    // A lid of 4 x 4 px closes at four moments while the whole picture slowly brightens by far more.
    const [closed, length] = [[90, 300, 301, 450, 570], 601];
    const pictures = Array.from({ length }, (_, index): Grey => {
      const values = new Uint8ClampedArray(16 * 16).fill(40 + Math.round((index * 150) / length));
      for (let y = 4; y < 8; y += 1) values.fill(closed.includes(index) ? 60 : 20, y * 16 + 4, y * 16 + 8);
      return { width: 16, height: 16, values };
    });
    const candidates = candidateFrames(3 * (length - 1) + 1);
    expect(candidates).toHaveLength(length);
    const chosen = chooseFrames({ candidates, pictures, eyes: NO_EYES }, [], 2);
    expect(chosen).toEqual(expect.arrayContaining([0, 270, 900, 1_350, 1_710]));
    expect(chosen.length).toBeLessThanOrEqual(20);
    const relabelled = chooseFrames({ candidates, pictures, eyes: NO_EYES }, [4], 2);
    expect(relabelled).toEqual(expect.arrayContaining([4, 270, 900, 1_350, 1_710]));
    expect(briefChanges(pictures.slice(0, 120))).toEqual([]);
  });
  it("are as unlike as there are, and never the same picture twice", () => {
    const pictures = [10, 11, 200, 201, 100, 10].map(flat);
    expect(farthestPictures(pictures, 3)).toEqual([0, 3, 4]);
    expect(farthestPictures(pictures, 3, [2])).toEqual([0, 2, 4]);
    expect(farthestPictures(pictures, 20)).toHaveLength(5);
  });
});

describe("points under the pointer", () => {
  it("are the nearest ones, each at its own centre, however small the eyes are shown", () => {
    const shape = templateShape(2, [640, 480]).map(([x, y]): Point => [0.2 * x, 0.2 * y]);
    expect(shape.map((point) => nearestPoint(shape, point, 11))).toEqual(shape.map((_, index) => index));
  });
  it("are none farther away than the reach", () => {
    expect(nearestPoint([[0, 0]], [8, 8], 11)).toBeNull();
    expect(nearestPoint([[0, 0]], [8, 7], 11)).toBe(0);
    expect(nearestPoint([], [0, 0], 11)).toBeNull();
  });
});

describe("undo", () => {
  it("goes back and forth, a drag in one step", () => {
    let history = changed(begun(0), 1, "drag 1");
    history = changed(changed(history, 2, "drag 1"), 3, "drag 2");
    expect(undone(history).now).toBe(2);
    expect(undone(undone(history)).now).toBe(0);
    expect(redone(undone(history)).now).toBe(3);
    expect(changed(undone(history), 9).future).toEqual([]);
  });
});

describe("the work on a video", () => {
  const unread = () => Promise.reject(new Error("no pixels here"));
  const video = { name: "a.mp4", size: SIZE, frameCount: 30, seconds: 1, frame: unread, smallPictures: unread, close: () => undefined };
  const looked = { candidates: [0, 10, 20], pictures: [10, 100, 200].map(flat), eyes: NO_EYES };
  const opened = withVideo(NO_WORK, video, looked);
  const shape = templateShape(2, SIZE);
  const accepted = (work: Work): number[] => [...work.history.now].filter(([, frame]) => frame.accepted).map(([number]) => number);

  it("begins with unlike frames and nothing to save", () => {
    expect([opened.chosen, opened.current, opened.history.now.size]).toEqual([[0, 10, 20], 0, 0]);
    expect(opened.history.now).toBe(opened.saved);
    for (const same of [atFrame(NO_WORK, 3), atNeighbour(NO_WORK, 1), withAccepted(NO_WORK, shape), withoutCurrent(NO_WORK)]) {
      expect(same).toBe(NO_WORK);
    }
  });
  it("accepts what stimuli takes, and says what it would refuse", () => {
    expect(accepted(withAccepted(opened, shape))).toEqual([0]);
    const crossed = withPoint(shape, 1, at(shape, 3), SIZE);
    const refused = withAccepted(opened, crossed);
    expect([accepted(refused), refused.problem]).toEqual([[], expect.stringContaining("points 2 and 3 cross")]);
    expect(atNeighbour(refused, 1).problem).toBeNull();
  });
  it("takes acceptance back when a point is moved out of order, and keeps it for a fine move", () => {
    const done = withAccepted(opened, shape);
    const [x, y] = at(shape, 3);
    const fine = withMove(done, shape, { index: 3, to: [x, y - 1], kind: "point", step: null });
    expect([accepted(fine), fine.problem]).toEqual([[0], null]);
    const crossed = withMove(done, shape, { index: 1, to: [x, y], kind: "point", step: null });
    expect([accepted(crossed), crossed.problem]).toEqual([[], expect.stringContaining("cross")]);
    expect([accepted(withUndo(crossed)), withUndo(crossed).problem]).toEqual([[0], null]);
    expect(accepted(withRedo(withUndo(crossed)))).toEqual([]);
  });
  it("goes from frame to frame inside the video; one asked for joins those to label", () => {
    expect(atNeighbour(opened, -1)).toBe(opened);
    expect(atNeighbour(atNeighbour(opened, 1), 1).current).toBe(20);
    expect(atFrame(opened, 99)).toMatchObject({ current: 29, chosen: [0, 10, 20, 29] });
    expect(atFrame(opened, -1)).toMatchObject({ current: 0, chosen: [0, 10, 20] });
  });
  it("removes a frame's points so that undo brings them back", () => {
    const removed = withoutCurrent(withAccepted(opened, shape));
    expect(accepted(removed)).toEqual([]);
    expect(accepted(withUndo(removed))).toEqual([0]);
  });
  it("takes labels of this video with their markers, and refuses another's", () => {
    const text = (size: readonly number[], frame: number): string =>
      JSON.stringify({ image_size_px: size, frames: { [frame]: shape }, mid_upper: [[2], [11]], origin: "me" });
    const loaded = withLabels(withAccepted(opened, shape), "a.json", parseLabels("a.json", text(SIZE, 12)));
    expect([accepted(loaded), loaded.current, loaded.chosen]).toEqual([[12], 12, [0, 12, 20]]);
    expect(loaded.markers).toMatchObject({ midUpper: [[2], [11]], rest: { origin: "me" } });
    expect([loaded.history.now === loaded.saved, withUndo(loaded).history.now]).toEqual([true, loaded.saved]);
    expect(() => withLabels(opened, "a.json", parseLabels("a.json", text([900, 480], 1)))).toThrow("900 x 480 pixels");
    expect(() => withLabels(opened, "a.json", parseLabels("a.json", text(SIZE, 30)))).toThrow("ends at frame 29");
  });
  it("lets frames wait that are as a program proposed them, and saves accepted ones as no proposals", () => {
    const moved = withPoint(shape, 3, [at(shape, 3)[0], at(shape, 3)[1] - 2], SIZE);
    const text = JSON.stringify({ image_size_px: SIZE, frames: { 5: shape, 12: moved, 20: shape }, proposed: { 5: shape, 12: shape } });
    const loaded = withLabels(opened, "a.json", parseLabels("a.json", text));
    expect([accepted(loaded), loaded.current]).toEqual([[12, 20], 5]);
    const saved = labelFileOf(withAccepted(loaded, shape));
    expect([[...(saved?.frames.keys() ?? [])], saved?.rest["proposed"]]).toEqual([[5, 12, 20], {}]);
    expect([...(labelFileOf(loaded)?.frames.keys() ?? [])]).toEqual([12, 20]);
  });
  it("starts over with another number of eyes and keeps the frames to label", () => {
    const one = withEyes({ ...withAccepted(opened, shape), selected: 12 }, 1);
    expect(one).toMatchObject({ eyes: 1, selected: null, chosen: [0, 10, 20], markers: { midLower: [[7]] } });
    expect(one.history.now.size).toBe(0);
  });
});

describe("label files", () => {
  const shape = templateShape(2, SIZE);
  const file = (frames: Record<string, Shape>, rest: object = {}): string =>
    JSON.stringify({ video: "a.mp4", image_size_px: SIZE, frames, ...rest });

  it("come back as they were, with keys of others", () => {
    const labels = parseLabels("a.json", file({ 12: shape, 3: shape }, { origin: "me", mid_upper: [[2], [11]], mid_lower: [[7], [16]] }));
    expect([...labels.frames.keys()]).toEqual([3, 12]);
    const again = parseLabels("b.json", labelsText(labels));
    expect(again.rest).toEqual({ origin: "me" });
    expect(again.midUpper).toEqual([[2], [11]]);
    expect(again.eyes).toBe(2);
    expect(at(again.frames.get(12) ?? [], 0)[0]).toBeCloseTo(at(shape, 0)[0], 3);
  });
  it.each([
    ["{", "not a label file in JSON"],
    ["[]", "expected a JSON object"],
    [JSON.stringify({ frames: {} }), "image_size_px"],
    [file({ x: shape }), "expected a frame number from 0, found 'x'"],
    [file({ 1: shape.slice(1) }), "frame 1: expected 18 points (or 9 for one eye), found 17"],
    [file({ 1: shape, 2: shape.slice(0, 9) }), "some frames have 9 points and some 18; label all alike"],
    [file({ 1: shape }, { mid_upper: [[2]] }), "'mid_upper' with one list of points for each of 2 eyes"],
    [file({ 1: shape }, { mid_upper: [[2], [3]] }), "names [3], expected points 9 to 17"],
  ])("say what is wrong with file %#", (text, words) => {
    expect(() => parseLabels("a.json", text)).toThrow(words);
  });
  it.each([
    [withPoint(shape, 3, [700, 100], [900, 480]), "point 4 at (700, 100) is outside the picture of 640 x 480"],
    [[...shape.slice(9), ...shape.slice(0, 9)], "the eyes are swapped"],
    [withPoint(shape, 5, [at(shape, 0)[0] + 1, at(shape, 0)[1]], SIZE), "canthi 1 and 6 are less than 4 px apart"],
    [withPoint(shape, 1, at(shape, 3), SIZE), "points 2 and 3 cross"],
    [withPoint(shape, 16, [at(shape, 16)[0], at(shape, 16)[1] - 50], SIZE), "lower-lid point 17 lies above the upper lid"],
  ])("refuse shape %# as stimuli does", (wrong, words) => {
    expect(() => checkShape("frame 1", wrong, SIZE)).toThrow(words);
    expect(() => checkShape("frame 1", shape, SIZE)).not.toThrow();
  });
  it("turn an eye about its other corner", () => {
    const one = templateShape(1, SIZE);
    const [fixed, held] = [at(one, 0), at(one, 5)];
    const turned = withEyeStretched(one, 5, [fixed[0] + (held[0] - fixed[0]) / 2, fixed[1] + (held[1] - fixed[1]) / 2], SIZE);
    expect(at(turned, 0)).toEqual(fixed);
    expect(at(turned, 2)[1] - fixed[1]).toBeCloseTo((at(one, 2)[1] - fixed[1]) / 2);
  });
});

/** An eye painted at a place, open so far, and its nine points. */
function paintedEye(dx: number, dy: number, open: number): { picture: Grey; shape: Shape } {
  const [width, height] = [200, 120];
  const gap = (u: number): number => open * 18 * (1 - (u / 40) ** 2);
  const values = new Uint8ClampedArray(width * height);
  for (let pixel = 0; pixel < values.length; pixel += 1) {
    const [u, v] = [(pixel % width) - 100 - dx, Math.floor(pixel / width) - 60 - dy];
    const skin = 160 + 14 * Math.sin(u / 6) + 12 * Math.cos(v / 5 + u / 11);
    const eyeball = u * u + v * v < 150 ? 50 : 225;
    const depth = Math.abs(u) < 40 ? gap(u) - Math.abs(v) : -1;
    values[pixel] = depth > 0 ? eyeball : Math.abs(depth) < 2 && Math.abs(u) < 42 ? 90 : skin;
  }
  const point = (u: number, side: number): Point => [100 + dx + u, 60 + dy + side * gap(u)];
  const shape = [...[-40, -24, -8, 8, 24, 40].map((u) => point(u, -1)), ...[20, 0, -20].map((u) => point(u, 1))];
  return { picture: { width, height, values }, shape };
}

describe("proposals", () => {
  const labelled = [paintedEye(0, 0, 1), paintedEye(3, 2, 0.1), paintedEye(-4, 1, 0.5)];
  it.each([
    ["open", 6, -4, 1],
    ["closed", -5, 5, 0.1],
    ["half open", 2, 6, 0.5],
    ["nearly open", -3, -3, 0.93],
  ])("find an eye that is %s and has moved", (_what, dx, dy, open) => {
    const { picture, shape } = paintedEye(dx, dy, open);
    const proposed = proposeShape(picture, labelled);
    const errors = shape.map(([x, y], index) => Math.hypot(at(proposed, index)[0] - x, at(proposed, index)[1] - y));
    expect(Math.max(...errors)).toBeLessThan(0.6);
  });
  it("need a labelled frame", () => {
    expect(() => proposeShape(paintedEye(0, 0, 1).picture, [])).toThrow("at least one labelled frame");
  });
});

describe("blink reviews", () => {
  const TABLE = `number,column,onset_frame,minimum_frame,end_frame,end_s,closure,accepted,reason
1,gap_l,90,100,130,0.433333,1,True,
2,gap_l,200,220,260,0.866667,0.6,False,"talking, loudly"
1,gap_r,91,101,131,0.436667,1,True,`;
  const { blinks, fps, decisions } = parseBlinks("b.csv", TABLE);
  const [first, second] = blinks;
  if (first === undefined || second === undefined) throw new Error("expected two blinks");

  it("begin with the table's own decisions", () => {
    expect(fps).toBeCloseTo(300, 2);
    expect(decisionOn(decisions, second)).toMatchObject({ decision: "reject", reason: "talking, loudly" });
    expect(decisionOn(decisions, first).decision).toBe("accept");
  });
  it("come back as they were written, lost rows too", () => {
    const moved = withEdge(first, "end", 140, blinks, decisions, 1_000);
    const lost = { column: "gap_l", minimum: 900, decision: "reject", reason: "old", onset: null, end: null } as const;
    const text = reviewText(blinks, moved, [lost]);
    expect(text.split("\n")).toEqual([
      "column,minimum_frame,decision,reason,onset_frame,end_frame",
      "gap_l,900,reject,old,,",
      "gap_l,100,accept,,,140",
      'gap_l,220,reject,"talking, loudly",,',
      "",
    ]);
    const again = decide(blinks, parseReview("r.csv", text), fps);
    expect(again.decisions).toEqual(moved);
    expect(again.lost).toEqual([lost]);
  });
  it("write no columns of moves where nothing moved", () => {
    expect(reviewText(blinks, decisions, []).split("\n")[0]).toBe("column,minimum_frame,decision,reason");
  });
  it("keep starts and ends before and after the minimum and out of the neighbours", () => {
    expect(edgeLimits(second, "onset", blinks, decisions, 1_000)).toEqual([130, 219]);
    expect(edgeLimits(first, "end", blinks, decisions, 1_000)).toEqual([101, 200]);
    expect(edgeLimits(second, "end", blinks, decisions, 300)).toEqual([221, 300]);
    const far = withEdge(first, "end", 5_000, blinks, decisions, 1_000);
    expect(edgesOf(first, far)).toEqual({ onset: 90, end: 200 });
    expect(withEdge(first, "end", 130, blinks, far, 1_000)).toEqual(decisions);
  });
  it("forget a decision that is taken back", () => {
    const back = withDecision(decisions, second, { decision: "accept", reason: "", onset: null, end: null });
    expect(back.size).toBe(0);
  });
  it.each([
    ["a,b\n1,2", "expected a column 'column'"],
    ["column,minimum_frame,decision,reason\ng,1,perhaps,", "unknown decision 'perhaps'"],
    ["column,minimum_frame,decision,reason\ng,x,accept,", "minimum_frame must be a whole number"],
    ["column", "expected a CSV table"],
  ])("say what is wrong with review %#", (text, words) => {
    expect(() => parseReview("r.csv", text)).toThrow(words);
  });
});

describe("traces", () => {
  it("break where there is no value, and keep the extremes where samples are dense", () => {
    const values = traceOf(parseTable("s.csv", "frame, d\n0, 1\n1, 2\n2,\n3, 1"), "d");
    expect(tracePath(values, { from: 0, to: 3 }, 30, 10, [1, 2])).toBe("M0.0 10.0L10.0 0.0M30.0 10.0");
    const dense = Float64Array.from({ length: 1_000 }, (_, frame) => (frame === 555 ? 9 : frame % 2));
    expect(tracePath(dense, { from: 0, to: 999 }, 100, 90, [0, 9])).toContain(" 0.0L");
  });
  it("zoom about a place and stay inside the recording", () => {
    expect(zoomedWindow({ from: 0, to: 100 }, 0.5, 50, 1_000)).toEqual({ from: 25, to: 75 });
    expect(zoomedWindow({ from: 900, to: 1_000 }, 20, 1_000, 1_000)).toEqual({ from: 0, to: 1_000 });
  });
});
