import { describe, expect, it } from "vitest";
import { Refused } from "../../src/admin/api";
import { batchesOf, persistently } from "../../src/admin/clips/useUpload";

const sized = (...sizes: number[]) => sizes.map((size) => ({ size }));

describe("requests of an upload", () => {
  it("hold at most so many files and bytes, in order, and none is lost", () => {
    const files = sized(5, 5, 5, 30, 1, 1, 1, 1);
    const batches = batchesOf(files, { files: 3, bytes: 12 });
    expect(batches.map((batch) => batch.map(({ size }) => size))).toEqual([[5, 5], [5], [30], [1, 1, 1], [1]]);
    expect(batches.flat()).toEqual(files);
  });

  it("are tried again while the line is broken, and not where they are refused", async () => {
    let tries = 0;
    const later = () => {
      tries += 1;
      return tries < 3 ? Promise.reject(new Refused(0, "offline", "away")) : Promise.resolve("there");
    };
    expect(await persistently(later, [0, 0, 0])).toBe("there");
    expect(tries).toBe(3);
    const refused = () => {
      tries += 1;
      return Promise.reject(new Refused(422, "invalid", "no"));
    };
    await expect(persistently(refused, [0, 0])).rejects.toThrow("no");
    expect(tries).toBe(4);
  });

  it("give up after the last wait", async () => {
    await expect(persistently(() => Promise.reject(new Refused(503, "busy", "busy")), [0])).rejects.toThrow("busy");
  });
});
