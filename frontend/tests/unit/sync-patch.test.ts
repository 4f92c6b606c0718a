import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { drawSyncPatch, patchFields } from "../../src/participant/playback/sync-patch";

// Written by tests/golden/sync_patch.py from the code that reads the patch.
const GOLDEN = JSON.parse(readFileSync("../tests/golden/sync_patch.json", "utf8")) as Record<string, string>;

function canvas(width: number, height: number) {
  const rectangles: [string, number, number, number, number][] = [];
  const context = {
    canvas: { width, height },
    fillStyle: "",
    fillRect: (x: number, y: number, w: number, h: number) => void rectangles.push([context.fillStyle, x, y, w, h]),
  };
  return { context, rectangles };
}

describe("sync patch", () => {
  it.each(Object.entries(GOLDEN))("frame %s is drawn as it is read", (number, fields) => {
    expect(patchFields(Number(number)).map(Number).join("")).toBe(fields);
  });

  it("is white without a frame", () => {
    expect(patchFields(null)).toEqual(Array(9).fill(true));
  });

  it("lies in the lower left corner, black around", () => {
    const { context, rectangles } = canvas(960, 360);
    drawSyncPatch(context, 1);
    expect(rectangles[0]).toEqual(["#000", 0, 210, 150, 150]);
    expect(rectangles.slice(1)).toEqual([
      ["#fff", 30, 240, 30, 30],
      ["#fff", 60, 270, 30, 30],
    ]);
  });
});
