import { describe, expect, it, vi } from "vitest";
import { ClipCache, ClipUnavailable, fetchClip, sha256 } from "../../src/participant/preload/clip-cache";

const bytes = new TextEncoder().encode("a clip").buffer;
const pause = (): Promise<void> => Promise.resolve();
const reply = (body: ArrayBuffer | null, status = 200): Response => new Response(body, { status });

async function source() {
  return { clip_sha256: await sha256(bytes), clip_url: "http://server/clip" };
}

describe("one clip", () => {
  it("is tried again after a break and after a wrong hash, then past the cache", async () => {
    const answers = [
      () => Promise.reject(new TypeError("down")),
      () => Promise.resolve(reply(new ArrayBuffer(3))),
      () => Promise.resolve(reply(bytes)),
    ];
    const fetching = vi
      .spyOn(globalThis, "fetch")
      .mockImplementation(() => answers.shift()?.() ?? Promise.reject(new Error("expected three requests at most")));
    expect(new Uint8Array(await fetchClip(await source(), { pause }))).toEqual(new Uint8Array(bytes));
    expect(fetching.mock.calls.map(([, init]) => init?.cache)).toEqual(["default", "default", "reload"]);
  });

  it.each([
    ["missing", () => Promise.resolve(reply(null, 404))],
    ["corrupt", () => Promise.resolve(reply(new ArrayBuffer(5)))],
    ["offline", () => Promise.resolve(reply(null, 503))],
  ])("is given up as %s", async (fault, answer) => {
    vi.spyOn(globalThis, "fetch").mockImplementation(answer);
    await expect(fetchClip(await source(), { pause, attempts: 3 })).rejects.toMatchObject({ fault });
  });

  it("is stopped where no byte comes", async () => {
    vi.spyOn(globalThis, "fetch").mockImplementation(
      (_url, init) =>
        new Promise((_resolve, reject) => init?.signal?.addEventListener("abort", () => reject(new DOMException("stopped", "AbortError")))),
    );
    await expect(fetchClip(await source(), { pause, attempts: 2, stall_ms: 10 })).rejects.toMatchObject({ fault: "offline" });
  });
});

describe("the clips of a block", () => {
  const sources = Array.from({ length: 12 }, (_, n) => ({ clip_sha256: `${n}`, clip_url: `/${n}` }));

  it("come four at a time, each once", async () => {
    let running = 0;
    let most = 0;
    const fetchOne = vi.fn(async () => {
      most = Math.max(most, (running += 1));
      await new Promise((resolve) => setTimeout(resolve, 2));
      running -= 1;
      return bytes;
    });
    const cache = new ClipCache(fetchOne);
    const seen: number[] = [];
    await Promise.all([cache.load([...sources, ...sources], ({ done }) => seen.push(done)), cache.load(sources)]);
    expect(fetchOne).toHaveBeenCalledTimes(12);
    expect(most).toBeLessThanOrEqual(8);
    expect(seen.at(-1)).toBe(12);
  });

  it("are reported where they could not be loaded, and the others are here", async () => {
    const cache = new ClipCache(({ clip_sha256 }) =>
      clip_sha256 === "3" ? Promise.reject(new ClipUnavailable("3", "missing")) : Promise.resolve(bytes),
    );
    expect((await cache.load(sources)).map((failure) => failure.sha256)).toEqual(["3"]);
    expect(cache.get("4")).toBe(bytes);
    cache.keepOnly(sources.slice(0, 2));
    expect([cache.get("1"), cache.get("4")]).toEqual([bytes, undefined]);
  });
});
