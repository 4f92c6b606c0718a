import { expect, it, vi } from "vitest";

import type { RatingIn, ShownClipRating } from "../../src/api/schema";
import type { Session } from "../../src/participant/session";
import { simulatedRating } from "../../src/participant/kinds/clip_rating/simulate";
import { actWhileShown } from "../../src/participant/trials/answers";
import { aTrial } from "./a-trial";

// It asks for a window when it is loaded.
vi.mock("jspsych", () => ({ initJsPsych: vi.fn(), ParameterType: {} }));

const SCALE = { name: "rating", type: "points", minimum: 1, maximum: 5 } as ShownClipRating["scales"][number];

/** What is sent of a simulated rating of a study with this reference. */
async function sent(reference: ShownClipRating["reference"]): Promise<RatingIn[]> {
  const bodies: RatingIn[] = [];
  const session = {
    run: { trial: { kind: "clip_rating", scales: [SCALE], reference } },
    screen: { record: () => ({}) },
    interaction: { take: () => null },
    clock: { elapsed: () => 0, shift: () => 0 },
    outbox: {
      durable: true,
      put: (_method: string, _path: string, body: RatingIn) => {
        bodies.push(body);
        return Promise.resolve({ receipt: new Promise(() => {}) });
      },
    },
  } as unknown as Session;
  await simulatedRating(session, { trial: aTrial(), play: 1, number: 1, total: 1, next: null });
  return bodies;
}

it("a simulated rating reports the declared gap after a reference, and none without one", async () => {
  const answers = { rating: { response: expect.any(Number) as number } };
  const [after] = await sent({ label: { en: "Reference" }, gap_ms: 2_000 });
  expect(after?.answer).toEqual({ kind: "clip_rating", answers, reference_gap_ms: 2_000 });
  const [alone] = await sent(null);
  expect(alone?.answer).toEqual({ kind: "clip_rating", answers });
});

it("a simulated person waits for a trial's page that is shown late, and stops when it is gone", () => {
  vi.useFakeTimers();
  const page = { isConnected: true };
  const shown: { page: typeof page | null } = { page: null };
  const act = vi.fn();
  actWhileShown({ querySelector: () => shown.page } as unknown as HTMLElement, act);
  vi.advanceTimersByTime(2_000);
  expect(act).not.toHaveBeenCalled();
  shown.page = page;
  vi.advanceTimersByTime(1_000);
  expect(act).toHaveBeenCalledTimes(4);
  page.isConnected = false;
  vi.advanceTimersByTime(1_000);
  expect([act.mock.calls.length, vi.getTimerCount()]).toEqual([4, 0]);
  vi.useRealTimers();
});
