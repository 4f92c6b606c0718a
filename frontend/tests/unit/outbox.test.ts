import { IDBFactory } from "fake-indexeddb";
import { describe, expect, it, vi } from "vitest";
import { NetworkError, type Answer } from "../../src/participant/request";
import { backoff, nextBatch, Outbox } from "../../src/participant/outbox/outbox";
import { IndexedDbStore, type OutboxItem } from "../../src/participant/outbox/store";

type Reply = number | "silence";

/** A server that gives these answers, then 200 for ever, and remembers what it stored. */
function server(replies: Reply[] = []) {
  const got: { path: string; body: unknown; token: string }[] = [];
  const send = (_method: string, path: string, options: { token: string; body: unknown }): Promise<Answer> => {
    const reply = replies.shift() ?? 200;
    if (reply === "silence") return Promise.reject(new NetworkError("no answer"));
    got.push({ path, ...options });
    const body = reply < 300 ? { receipt: path } : { error: { code: "refused", message: "no" } };
    return Promise.resolve({ status: reply, body, retry_after_s: null });
  };
  return { got, send };
}

const noPause = (): Promise<void> => Promise.resolve();
const paths = (got: { path: string }[]): string[] => got.map((one) => one.path);

async function opened(factory: IDBFactory, replies: Reply[] = [], options = {}) {
  const fake = server(replies);
  const store = await IndexedDbStore.open(factory);
  const outbox = new Outbox(store, { send: fake.send, pause: noPause, ...options });
  await outbox.open("run", "token");
  return { ...fake, outbox, store };
}

describe("outbox", () => {
  it("keeps what is put before it sends, and forgets it only when acknowledged", async () => {
    const { outbox, store, got } = await opened(new IDBFactory(), ["silence", 503, 429, 201]);
    const sent = await outbox.put("PUT", "/a", { n: 1 });
    expect(await store.all()).toHaveLength(1);
    expect(await sent.receipt).toEqual({ accepted: true, body: { receipt: "/a" } });
    expect(await store.all()).toHaveLength(0);
    expect(paths(got)).toEqual(["/a", "/a", "/a"]);
  });

  it("goes on after an error that nobody expected", async () => {
    const fake = server();
    let faults = 2;
    const send = (...call: Parameters<typeof fake.send>): Promise<Answer> =>
      faults-- > 0 ? Promise.reject(new TypeError("a fault of the program")) : fake.send(...call);
    const { outbox, store } = await opened(new IDBFactory(), [], { send });
    await Promise.all(["/a", "/b"].map((path) => outbox.put("PUT", path, {})));
    expect(await outbox.drained(1_000)).toBe(true);
    expect(paths(fake.got)).toEqual(["/a", "/b"]);
    expect(await store.all()).toHaveLength(0);
  });

  it("sends in the order of putting", async () => {
    const { outbox, got } = await opened(new IDBFactory(), ["silence"]);
    await Promise.all(["/a", "/b", "/c"].map((path) => outbox.put("PUT", path, {})));
    await outbox.drained();
    expect(paths(got)).toEqual(["/a", "/b", "/c"]);
  });

  it("takes up after a reload what an earlier page left, with the newer token", async () => {
    const factory = new IDBFactory();
    const first = await opened(factory, [], { send: () => new Promise<Answer>(() => {}) });
    await first.outbox.put("PUT", "/left", { n: 7 });
    first.outbox.stop();
    const fake = server();
    const second = new Outbox(await IndexedDbStore.open(factory), { send: fake.send, pause: noPause });
    await second.open("run", "newer");
    expect(await second.drained(1_000)).toBe(true);
    expect(fake.got).toEqual([{ path: "/left", body: { n: 7 }, token: "newer" }]);
  });

  it("puts a refused write aside and goes on", async () => {
    const { outbox, store } = await opened(new IDBFactory(), [409]);
    const sent = await outbox.put("PUT", "/a", {});
    const next = await outbox.put("PUT", "/b", {});
    expect(await sent.receipt).toMatchObject({ accepted: false, refused: { status: 409, code: "refused" } });
    expect(await next.receipt).toMatchObject({ accepted: true });
    expect(await store.all()).toHaveLength(0);
  });

  it("reports what is refused for good, for this run only", async () => {
    const factory = new IDBFactory();
    const other = await opened(factory, ["silence", "silence"], { pause: () => new Promise<void>(() => {}) });
    await other.outbox.put("PUT", "/other", {});
    other.outbox.stop();
    const onRefused = vi.fn();
    const fake = server([401, 409]);
    const outbox = new Outbox(await IndexedDbStore.open(factory), { send: fake.send, pause: noPause, onRefused });
    await outbox.open("second run", "token");
    await (
      await outbox.put("PUT", "/a", {})
    ).receipt;
    expect(onRefused).toHaveBeenCalledOnce();
    expect(onRefused.mock.calls[0]?.[0]).toMatchObject({ status: 409 });
  });

  it("reports an accepted write before it forgets it", async () => {
    const factory = new IDBFactory();
    const seen: [string, unknown, number][] = [];
    const store = await IndexedDbStore.open(factory);
    let left = 1;
    const outbox = new Outbox(store, {
      send: server().send,
      pause: noPause,
      onAccepted: (item, body) => void seen.push([item.path, body, left]),
    });
    await outbox.open("run", "token");
    const { receipt } = await outbox.put("PUT", "/a", {});
    await receipt.then(() => (left = 0));
    expect(seen).toEqual([["/a", { receipt: "/a" }, 1]]);
  });

  it("sends events together, after the writes", async () => {
    const { outbox, got } = await opened(new IDBFactory(), ["silence", "silence"]);
    await Promise.all([outbox.putEvent({ id: "e1" }), outbox.put("PUT", "/a", {}), outbox.putEvent({ id: "e2" })]);
    await outbox.drained();
    expect(paths(got)).toContain("/a");
    expect((got.at(-1)?.body as { events: object[] }).events).toContainEqual({ id: "e2" });
  });

  it("goes on in memory, and reports it, when the disk fails", async () => {
    const { outbox, store, got } = await opened(new IDBFactory());
    expect(outbox.durable).toBe(true);
    vi.spyOn(console, "warn").mockImplementation(() => {});
    vi.spyOn(store, "add").mockRejectedValue(new DOMException("full", "QuotaExceededError"));
    expect(await (await outbox.put("PUT", "/a", {})).receipt).toMatchObject({ accepted: true });
    expect([outbox.durable, paths(got)]).toEqual([false, ["/a"]]);
  });

  it("says after the limit that not all was sent", async () => {
    const { outbox } = await opened(new IDBFactory(), [], { send: () => new Promise<Answer>(() => {}) });
    await outbox.put("PUT", "/a", {});
    expect(await outbox.drained(20)).toBe(false);
  });
});

describe("batches and back-off", () => {
  const event = (n: number): OutboxItem => ({
    id: `${n}`,
    run_id: "r",
    token: "t",
    kind: "event",
    method: "POST",
    path: "",
    body: n,
    sequence: n,
  });

  it("puts at most 100 events into a call", () => {
    const batch = nextBatch(Array.from({ length: 130 }, (_, n) => event(n)));
    expect(batch?.items).toHaveLength(100);
    expect(nextBatch([])).toBeNull();
  });

  it("waits from half a second to 15 s", () => {
    const waits = [1, 2, 3, 4, 5, 6, 20].map((failures) => backoff(failures, () => 0.5));
    expect(waits).toEqual([500, 1_000, 2_000, 4_000, 8_000, 15_000, 15_000]);
    expect(backoff(1, () => 0)).toBe(375);
  });
});

describe("a record that is refused for good", () => {
  const rating = "/api/run/ratings/1";

  it.each([400, 403, 404, 409, 413, 422])("is reported in its place and never sent again: %i", async (status) => {
    const factory = new IDBFactory();
    const { outbox, store, got } = await opened(factory, [status, "silence", 202]);
    const sent = await outbox.put("PUT", rating, { trial_index: 1 }, "one");
    expect((await sent.receipt).accepted).toBe(false);
    expect(outbox.state.pending).toBe(1);
    await outbox.drained();
    expect(paths(got)).toEqual([rating, "/api/run/refused"]);
    const refusal = { id: "one", path: rating, status, code: "refused", message: "no", body: { trial_index: 1 } };
    expect(got[1]?.body).toEqual(refusal);
    expect(await store.all()).toEqual([]);
  });

  it("is not reported again where the report is refused", async () => {
    const { outbox, store, got } = await opened(new IDBFactory(), [422, 404]);
    await outbox.put("PUT", rating, {}, "one");
    await outbox.drained();
    expect(paths(got)).toEqual([rating, "/api/run/refused"]);
    expect(await store.all()).toEqual([]);
  });

  it("keeps its report over a reload", async () => {
    const factory = new IDBFactory();
    const silence = Array.from({ length: 50 }, () => "silence" as const);
    const first = await opened(factory, [422, ...silence], { pause: () => new Promise<void>(() => {}) });
    await (
      await first.outbox.put("PUT", rating, { trial_index: 1 }, "one")
    ).receipt;
    first.outbox.stop();
    const second = await opened(factory);
    await second.outbox.drained();
    expect(paths(second.got)).toEqual(["/api/run/refused"]);
  });

  it("leaves what is said of the visit to the page", async () => {
    const { outbox, got } = await opened(new IDBFactory(), [401]);
    await outbox.put("PUT", rating, {}, "one");
    await outbox.drained();
    expect(paths(got)).toEqual([rating]);
  });
});

describe("what is still to be sent", () => {
  it("is counted in answers, not in records", async () => {
    const silence = Array.from({ length: 50 }, () => "silence" as const);
    const { outbox } = await opened(new IDBFactory(), silence, { pause: () => new Promise<void>(() => {}) });
    for (const path of ["/api/run/views", "/api/run/ratings/1", "/api/run/views", "/api/run/ratings/2", "/api/run/stage"])
      await outbox.put("PUT", path, {});
    expect(outbox.state.pending).toBe(2);
  });
});

describe("a disk that says nothing", () => {
  it("is left alone, and the answer is sent from memory", async () => {
    const { send, got } = server();
    const silent = (): Promise<never> => new Promise(() => {});
    const store = { durable: true, add: silent, all: silent, remove: silent, refuse: silent };
    const outbox = new Outbox(store, { send, pause: noPause, disk_limit_ms: 1 });
    await outbox.open("run", "token");
    const sent = await outbox.put("PUT", "/api/run/ratings/1", {});
    expect((await sent.receipt).accepted).toBe(true);
    expect([outbox.durable, paths(got)]).toEqual([false, ["/api/run/ratings/1"]]);
  });
});
