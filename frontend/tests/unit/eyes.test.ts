import { describe, expect, it } from "vitest";
import { eyesFor, type EyesOfVideo, type FoundEyes, NO_EYES, noticeOf, placesOn, shapeOn } from "../../src/labelling/eyes";
import { type Grey, thumbnailOf, cut } from "../../src/labelling/grey";
import { checkShape } from "../../src/labelling/label-file";
import { chooseFrames } from "../../src/labelling/labelled-frames";
import { at, eyeOf, eyeWidth, type Point } from "../../src/labelling/points";
import { seeEyes } from "../../src/labelling/follow-eyes";
import { startShape } from "../../src/labelling/propose";

const [WIDTH, HEIGHT, COUNT, SECONDS] = [200, 120, 130, 0.1];
const BLINKS = [20, 47, 48, 75, 110];

/** An even grain that is the same at every run: what skin and walls look like to a search. */
function grain(x: number, y: number): number {
  return 14 * Math.sin(0.31 * x + 1.7 * Math.sin(0.13 * y)) + 11 * Math.cos(0.23 * y + 1.3 * Math.cos(0.19 * x));
}

/** Where the head is: it drifts and nods all the time. */
function headAt(index: number): Point {
  return [5 * Math.sin(index / 17), 4 * Math.sin(index / 6)];
}

/** A head with eyes before a wall; an eye is white with a dark iris, and skin with a lash line when closed. */
function painted(index: number, eyes: readonly Point[], width: number, isClosed: boolean): Grey {
  const [dx, dy] = headAt(index);
  const values = new Uint8ClampedArray(WIDTH * HEIGHT);
  for (let y = 0; y < HEIGHT; y += 1) {
    for (let x = 0; x < WIDTH; x += 1) values[y * WIDTH + x] = luminance(x, y, [dx, dy], eyes, width, isClosed);
  }
  return { width: WIDTH, height: HEIGHT, values };
}

function luminance(x: number, y: number, [dx, dy]: Point, eyes: readonly Point[], width: number, isClosed: boolean): number {
  const [u, v] = [x - dx, y - dy];
  if (((u - 100) / 80) ** 2 + ((v - 60) / 56) ** 2 > 1) return 90 + grain(3 * x, 2 * y);
  for (const [ex, ey] of eyes) {
    const [a, b] = [(u - ex) / (width / 2), (v - ey) / (width / 5)];
    if (a * a + b * b > 1) continue;
    if (isClosed) return b > 0.6 ? 70 : 165 + grain(u, v);
    return Math.hypot(u - ex, v - ey) < width / 5 ? 30 : 210;
  }
  return 165 + grain(u, v);
}

function recording(eyes: readonly Point[], width: number, blinks: readonly number[]): Grey[] {
  return Array.from({ length: COUNT }, (_, index) => painted(index, eyes, width, blinks.includes(index)));
}

const BLINKING: FoundEyes = {
  width: 20,
  centres: [
    [
      [60, 50],
      [110, 60],
    ],
    [
      [62, 50],
      [112, 60],
    ],
  ],
  closed: [0, 1],
  blinks: [1],
};
const KNOWN: EyesOfVideo = { size: [200, 120], two: BLINKING, one: null, problem: null };

describe("eyes of a video", () => {
  const still = (): void => undefined;
  it("are found by their blinks and followed, though the head nods", () => {
    const eyes: Point[] = [
      [76, 52],
      [124, 55],
    ];
    const seen = seeEyes(recording(eyes, 21, BLINKS), SECONDS, still).two;
    expect([...(seen?.blinks ?? [])].sort((a, b) => a - b).map((index) => (index === 48 ? 47 : index))).toEqual([20, 47, 75, 110]);
    expect(Math.abs((seen?.width ?? 0) - 21)).toBeLessThan(3);
    for (let index = 0; index < COUNT; index += 1) {
      const [dx, dy] = headAt(index);
      eyes.forEach(([x, y], eye) => {
        const [u, v] = seen?.centres[index]?.[eye] ?? [0, 0];
        expect(Math.hypot(u - x - dx, v - y - dy)).toBeLessThan(0.25 * 21);
      });
    }
    expect(seen?.closed[75]).toBeGreaterThan(0.7);
    expect(Math.abs(seen?.closed[60] ?? 1)).toBeLessThan(0.2);
  });
  it("are not found where none blinks", () => {
    const eyes: Point[] = [
      [76, 52],
      [124, 55],
    ];
    expect(seeEyes(recording(eyes, 21, []), SECONDS, still)).toMatchObject({ two: null, one: null });
  });
  it("are one where one fills the picture, and no pair within it", () => {
    const seen = seeEyes(recording([[100, 60]], 110, BLINKS), SECONDS, still);
    expect(seen.two).toBeNull();
    const [x, y] = seen.one?.centres[60]?.[0] ?? [0, 0];
    const [dx, dy] = headAt(60);
    expect(Math.hypot(x - 100 - dx, y - 60 - dy)).toBeLessThan(0.25 * 110);
    expect(seen.one?.blinks).toEqual(expect.arrayContaining([20, 75, 110]));
  });
  it("report the progress of the search, never backwards", () => {
    const shares: number[] = [];
    seeEyes(recording([[100, 60]], 110, BLINKS).slice(0, 30), SECONDS, (share) => shares.push(share));
    expect(shares.length).toBeGreaterThan(30);
    expect(shares).toEqual([...shares].sort((a, b) => a - b));
    expect(shares.at(-1)).toBeLessThanOrEqual(1);
  });
});

describe("the first shape", () => {
  it("lies on the eyes found, turned as they are, and is one that stimuli takes, open or closed", () => {
    for (const closed of [-0.2, 0, 0.5, 1, 1.4]) {
      const shape = shapeOn(placesOn(BLINKING, 0, [200, 120], [400, 240]), closed);
      expect(() => checkShape("frame 0", shape, [400, 240])).not.toThrow();
      const [left, right] = [eyeOf(shape, 0), eyeOf(shape, 1)];
      expect(eyeWidth(left)).toBeCloseTo(40, 0);
      expect(at(left, 0)[0]).toBeLessThan(at(left, 5)[0]);
      expect(at(right, 0)[0]).toBeGreaterThan(at(right, 5)[0]);
      expect((at(right, 0)[1] + at(right, 5)[1]) / 2).toBeGreaterThan((at(left, 0)[1] + at(left, 5)[1]) / 2 + 15);
      const gap = at(left, 7)[1] - at(left, 2)[1];
      if (closed <= 0) expect(gap).toBeGreaterThan(10);
      if (closed >= 1) expect(gap).toBeLessThan(4);
    }
  });
  it("is that of the nearest picture looked at, and at a fixed place where no eye was found", async () => {
    const unread = (): Promise<never> => Promise.reject(new Error("not read"));
    const close = (): void => undefined;
    const video = { name: "a", size: [200, 120], frameCount: 9, seconds: 1, frame: unread, smallPictures: unread, close } as const;
    const start = async (eyes: EyesOfVideo) => {
      const canvas = {} as HTMLCanvasElement;
      return startShape({ video, looked: { candidates: [0, 8], pictures: [], eyes } }, { number: 7, canvas }, [], 2, new Map());
    };
    const begun = await start(KNOWN);
    expect(begun.from).toBe("eyes");
    expect((at(begun.shape, 0)[0] + at(begun.shape, 5)[0]) / 2).toBeCloseTo(62, 0);
    expect((await start(NO_EYES)).from).toBe("template");
  });
});

describe("what was found", () => {
  it("is said, with where the shape lies else", () => {
    expect(noticeOf(KNOWN, 2)).toContain("Two eyes found by a blink;");
    expect(noticeOf(KNOWN, 1)).toContain("An eye found by a blink;");
    expect(noticeOf({ ...KNOWN, two: null, one: BLINKING }, 2)).toContain("Is this a close-up?");
    expect(noticeOf(NO_EYES, 2)).toMatch(/^No blinking eyes were found\..*middle of the picture/);
    expect(noticeOf({ ...NO_EYES, problem: "no worker" }, 1)).toContain("The search for eyes failed (no worker)");
    expect(eyesFor(KNOWN, 1)?.centres[0]).toEqual([[60, 50]]);
  });
  it("puts blinks among the frames chosen, even of a short recording", () => {
    const pictures = Array.from({ length: 60 }, (_, index): Grey => {
      return { width: 4, height: 4, values: new Uint8ClampedArray(16).fill(index < 2 ? 50 : 2 * index) };
    });
    const eyes: EyesOfVideo = { ...KNOWN, two: { ...BLINKING, blinks: [33, 7] } };
    const candidates = pictures.map((_, index) => 3 * index);
    expect(chooseFrames({ candidates, pictures, eyes }, [], 2)).toEqual(expect.arrayContaining([0, 21, 99]));
  });
});

describe("small pictures", () => {
  it("are means of squares", () => {
    const picture = { width: 256, height: 8, values: new Uint8ClampedArray(256 * 8).map((_, pixel) => ((pixel % 256) % 4 < 2 ? 40 : 80)) };
    const small = thumbnailOf(picture);
    expect([small.width, small.height]).toEqual([64, 2]);
    expect([...new Set(small.values)]).toEqual([60]);
  });
  it("are cut between pixels, with the border's luminance beyond it", () => {
    const picture = { width: 3, height: 2, values: Uint8ClampedArray.from([0, 10, 20, 30, 40, 50]) };
    expect([...cut(picture, [1, 0.5], { columns: 3, rows: 1, step: 0.5 })]).toEqual([20, 25, 30]);
    expect([...cut(picture, [2, 1], { columns: 3, rows: 3, step: 2 })]).toEqual([0, 20, 20, 30, 50, 50, 30, 50, 50]);
  });
});
