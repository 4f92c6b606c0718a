import { describe, expect, it, vi } from "vitest";
import type { TrialInfo, ViewIn } from "../../src/api/schema";
import { Outbox } from "../../src/participant/outbox/outbox";
import { MemoryStore, type OutboxItem, type OutboxStore } from "../../src/participant/outbox/store";
import type { Session } from "../../src/participant/session";
import type { Shown } from "../../src/participant/trials/showing";
import { layout, refreshDropped, visibleShare, watchDisturbances } from "../../src/participant/views/disturbances";
import { applyViews, beginView, isFromBefore, settleInterrupted, viewsBefore } from "../../src/participant/views/ledger";

Object.assign(globalThis, { window: { innerWidth: 1280, innerHeight: 800, devicePixelRatio: 1 }, screen: { width: 1920, height: 1080 } });

/** A browser that keeps things, on a disk whose end the test decides. */
class Disk extends MemoryStore implements OutboxStore {
  override readonly durable = true as unknown as false;
  private release: () => void = () => {};
  private gate: Promise<void> = Promise.resolve();
  hold(): void {
    this.gate = new Promise((resolve) => (this.release = resolve));
  }
  go(): void {
    this.release();
  }
  override async add(item: OutboxItem): Promise<void> {
    await this.gate;
    await super.add(item);
  }
}

const trialOf = (rest: Partial<TrialInfo> = {}): TrialInfo =>
  ({
    trial_index: 3,
    kind: "main",
    clips: [
      { role: "left", clip_sha256: "aa", frames: 3 },
      { role: "right", clip_sha256: "bb", frames: 2 },
    ],
    plays_done: 0,
    views_begun: 0,
    views: [],
    ...rest,
  }) as unknown as TrialInfo;

const showing: Shown = {
  method: "webcodecs",
  key_at_ms: 100,
  ended_at_ms: 220.006,
  drawn: [
    [0, 110],
    [2, 177],
  ],
  frames: 3,
  fps: 30,
  stalls: 0,
  clock_gap_ms: 17,
  clock_late_ms: 1,
  focus_lost: 1,
  early_keys: 0,
  disturbances: { focus_lost: 1 },
  visible_share: 0.5,
  refresh_ms: 16.7,
};
const shown = [{ roles: ["left", "right"], showing }];

async function offline(trials: TrialInfo[] = []): Promise<{ session: Session; disk: Disk; kept: () => Promise<ViewIn[]> }> {
  const disk = new Disk();
  const outbox = new Outbox(disk, { send: () => new Promise(() => {}) });
  await outbox.open("r", "t");
  const session = { outbox, screen: { record: () => ({}) }, run: { trials } } as unknown as Session;
  const kept = async (): Promise<ViewIn[]> => (await disk.all()).flatMap((item) => (item.body as { views: ViewIn[] }).views);
  return { session, disk, kept };
}

describe("the view ledger", () => {
  it("says that a view is kept only when it is on disk", async () => {
    const { session, disk, kept } = await offline();
    disk.hold();
    let is_kept = false;
    const view = beginView(session, trialOf(), 1);
    void view.kept.then(() => (is_kept = true));
    await new Promise((resolve) => setTimeout(resolve, 5));
    expect([is_kept, await kept()]).toEqual([false, []]);
    disk.go();
    await view.kept;
    expect(await kept()).toMatchObject([{ trial_index: 3, number: 1, play: 1 }]);
  });

  it("carries the ticket of its play, and none where the run has none", async () => {
    const { session, kept } = await offline();
    Object.assign(session.run, { tickets: { batch: "b", by_trial: [[], [], [], ["first", "second"]] } });
    await beginView(session, trialOf(), 2).kept;
    Object.assign(session.run, { tickets: null });
    await beginView(session, trialOf(), 2).kept;
    expect((await kept()).map(({ evidence }) => evidence)).toEqual([{ batch: "b", ticket: "second" }, null]);
  });

  it("counts every view of a trial on, whatever its play", async () => {
    const { session, kept } = await offline();
    const trial = trialOf({ views_begun: 4 });
    await beginView(session, trial, 2).kept;
    await beginView(session, trial, 2).kept;
    expect((await kept()).map(({ number, play }) => [number, play])).toEqual([
      [5, 2],
      [6, 2],
    ]);
  });

  it("gives both clips of a view the same times", async () => {
    const { session, kept } = await offline();
    await beginView(session, trialOf(), 1).end(shown);
    const [left, right] = (await kept())[1]?.clips ?? [];
    expect(left?.drawn).toEqual([
      [0, 10],
      [2, 77],
    ]);
    expect(right?.drawn).toEqual([
      [0, 10],
      [1, 77],
    ]);
  });

  it("brings what was shown back from what was kept, marked", async () => {
    const { session, kept } = await offline();
    await beginView(session, trialOf(), 1).end(shown);
    const after = trialOf();
    applyViews([after], await kept());
    expect(after.views).toHaveLength(1);
    const [view] = viewsBefore(after, 1);
    const back = view?.[0]?.showing;
    const start = back?.key_at_ms ?? 0;
    expect(back?.drawn.map(([index, at_ms]) => [index, Math.round(at_ms - start)])).toEqual([
      [0, 10],
      [2, 77],
    ]);
    expect(back).toMatchObject({ frames: 3, clock_gap_ms: 17, visible_share: 0.5, disturbances: { focus_lost: 1, scale_reloaded: 1 } });
    expect(isFromBefore(back ? [back] : [])).toBe(true);
    expect(viewsBefore(after, 2)).toEqual([]);
  });

  it("ends what was left open, and files its play once, but not in practice", async () => {
    const open = { id: "v", number: 1, play: 1, started_at_client: "2026-11-21T10:00:00Z", ended: false };
    const views = [{ ...open, outcome: null, showings: null, clips: [], disturbances: {} }];
    const practice = trialOf({ trial_index: 0, kind: "practice", views });
    const main = trialOf({ views });
    const { session, kept } = await offline([practice, main]);
    const filed: [number, number][] = [];
    await settleInterrupted(session, (trial, play) => Promise.resolve(void filed.push([trial.trial_index, play])));
    expect(filed).toEqual([[3, 1]]);
    expect((await kept()).map(({ trial_index, outcome }) => [trial_index, outcome])).toEqual([
      [0, "interrupted"],
      [3, "interrupted"],
    ]);
  });

  it("has nothing to bring back once the play is answered", async () => {
    const { session, kept } = await offline();
    await beginView(session, trialOf(), 1).end(shown);
    const answered = trialOf({ plays_done: 1 });
    applyViews([answered], await kept());
    expect([answered.views, answered.views_begun]).toEqual([[], 1]);
  });
});

describe("disturbances", () => {
  const box = { left: 100, top: 100, right: 300, bottom: 200 };

  it("takes the share of the clip inside the window", () => {
    const seen = (right: number, bottom: number) => visibleShare(box, { left: 0, top: 0, right, bottom });
    expect([seen(1280, 800), seen(200, 800), seen(200, 150), seen(50, 50)]).toEqual([1, 0.5, 0.25, 0]);
    // Of a page that fingers have zoomed and moved.
    expect(visibleShare(box, { left: 200, top: 100, right: 712, bottom: 420 })).toBe(0.5);
  });

  it("counts one leaving of full screen once, however many clips come after it", () => {
    const page = Object.assign(new EventTarget(), { fullscreenElement: {}, hidden: false, hasFocus: () => true });
    vi.stubGlobal("document", page);
    vi.stubGlobal("window", Object.assign(new EventTarget(), { innerWidth: 1280, innerHeight: 800, devicePixelRatio: 1 }));
    const clip = { getBoundingClientRect: () => ({ ...box, width: 200, height: 100 }) } as HTMLElement;
    const before = layout();
    Reflect.set(page, "fullscreenElement", null);
    expect(watchDisturbances(clip, before).stop().counts).toEqual({ full_screen_left: 1 });
    expect(watchDisturbances(clip, before).stop().counts).toEqual({});
    vi.unstubAllGlobals();
  });

  it.each([
    ["another screen", { width: 2560, height: 1440 }, { zoomed: 1 }],
    ["a tablet turned", { width: 1080, height: 1920 }, {}],
  ])("counts %s between the layout and the clip as its rule says", (_what, now, counts) => {
    vi.stubGlobal("document", Object.assign(new EventTarget(), { fullscreenElement: null, hidden: false, hasFocus: () => true }));
    vi.stubGlobal("window", Object.assign(new EventTarget(), { innerWidth: 1280, innerHeight: 800, devicePixelRatio: 1 }));
    const clip = { getBoundingClientRect: () => ({ ...box, width: 200, height: 100 }) } as HTMLElement;
    const before = layout();
    vi.stubGlobal("screen", now);
    expect(watchDisturbances(clip, before).stop().counts).toEqual(counts);
    vi.unstubAllGlobals();
  });

  it("distinguishes another refresh rate from a hiccup", () => {
    expect(refreshDropped(33.3, 16.7)).toBe(true);
    expect(refreshDropped(17.5, 16.7)).toBe(false);
    expect(refreshDropped(null, 16.7)).toBe(false);
  });
});
