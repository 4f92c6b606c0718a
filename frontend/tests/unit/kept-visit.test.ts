import { describe, expect, it } from "vitest";
import type { LinkState, RunStarted, RunState } from "../../src/api/schema";
import { aTrial } from "./a-trial";
import { applyWrite, type Kept, KeptVisit } from "../../src/participant/flow/kept-visit";
import { owed } from "../../src/participant/session";

const NOW = Date.parse("2026-11-21T12:00:00Z");

class FakeStorage {
  readonly items = new Map<string, string>();
  getItem = (key: string): string | null => this.items.get(key) ?? null;
  setItem = (key: string, value: string): void => void this.items.set(key, value);
  removeItem = (key: string): void => void this.items.delete(key);
}

function visit(resumable_until: string | null = "2026-11-21T13:00:00Z"): Kept {
  const run = {
    status: "active",
    consented_at: null,
    answered_forms: [] as string[],
    trials: [aTrial(), aTrial({ trial_index: 1 })],
    elapsed_ms_before: 5,
    server_time: "2026-11-21T11:59:00Z",
    resumable_until,
    calibration: null,
  };
  return { link: {} as LinkState, started: { run_id: "r", run_token: "t" } as RunStarted, run: run as unknown as RunState };
}

const rating = (trial_index: number, play = 1) => ({
  kind: "write" as const,
  path: "/api/run/ratings/x",
  body: { trial_index, play, time_elapsed: 900, playback: {} },
});

function kept(storage = new FakeStorage(), begun: Kept | null = visit()): [KeptVisit, FakeStorage] {
  const keeping = new KeptVisit("key", storage);
  if (begun) keeping.begin(begun);
  return [keeping, storage];
}
const readAgain = (storage: FakeStorage, now = NOW): Kept | null => kept(storage, null)[0].read(now);

describe("the visit kept for a reload without a server", () => {
  it("knows what the server has accepted", () => {
    const [keeping, storage] = kept();
    keeping.note({ kind: "write", path: "/api/run/consent", body: { agreed: true } }, {});
    keeping.note({ kind: "write", path: "/api/run/forms/about", body: {} }, {});
    keeping.note({ kind: "event", path: "/api/run/events", body: {} }, {});
    keeping.note(rating(1), { receipt: { again: false } });
    const run = readAgain(storage)?.run;
    expect(run?.consented_at).toBe("2026-11-21T11:59:00Z");
    expect(run?.answered_forms).toEqual(["about"]);
    expect(run?.trials.map((one) => [one.answered, one.plays_done])).toEqual([
      [false, 0],
      [true, 1],
    ]);
    expect(run?.elapsed_ms_before).toBe(900);
  });

  it("remembers that a failed clip is wanted again, until it was shown", () => {
    const [keeping, storage] = kept();
    keeping.note(rating(0), { receipt: { again: true } });
    expect(owed(readAgain(storage)?.run.trials ?? []).map((one) => one.play)).toEqual([2]);
    keeping.note(rating(0, 2), { receipt: { again: false } });
    expect(owed(readAgain(storage)?.run.trials ?? [])).toEqual([]);
  });

  it("is nothing where the study wants to be asked, when its time is over, or when it was forgotten", () => {
    expect(readAgain(kept(new FakeStorage(), visit(null))[1])).toBeNull();
    const [keeping, storage] = kept();
    expect(readAgain(storage, NOW + 3_600_001)).toBeNull();
    expect(readAgain(storage)).not.toBeNull();
    keeping.forget();
    expect(readAgain(storage)).toBeNull();
  });

  it("does without a storage, with a broken one and with one that is full", () => {
    const full = Object.assign(new FakeStorage(), {
      setItem: () => {
        throw new Error("full");
      },
    });
    kept(full);
    expect(readAgain(full)).toBeNull();
    const broken = new FakeStorage();
    broken.setItem("key", "{");
    expect(readAgain(broken)).toBeNull();
    expect(new KeptVisit("key", null).read(NOW)).toBeNull();
  });

  it("gives away copies, so that what the page changes is not taken for accepted", () => {
    const [, storage] = kept();
    const [keeping] = kept(storage, null);
    const given = keeping.read(NOW);
    if (!given) throw new Error("expected the visit that was kept");
    applyWrite(given.run, rating(0));
    keeping.note(rating(1), {});
    expect(readAgain(storage)?.run.trials.map((one) => one.answered)).toEqual([false, true]);
  });
});
