import { expect, it, vi } from "vitest";

import type { Session } from "../../src/participant/session";
import { timeline } from "../../src/participant/flow/timeline";
import { aTrial } from "./a-trial";

// It asks for a window when it is loaded.
vi.mock("jspsych", () => ({ initJsPsych: vi.fn(), ParameterType: {} }));

const FORM = { name: "about", when: "before" };

/** What the pages before the trials say of their place, where this much was done when the page was loaded. */
function steps(consented_at: string | null, answered_forms: string[]): string[] {
  const session = {
    t: (key: string, { step, steps: total }: Record<string, number> = {}) => (key === "step" ? `${String(step)} of ${String(total)}` : ""),
    screen: { calibration: null },
    run: {
      awaits_group: true,
      consented_at,
      answered_forms,
      forms: [FORM],
      trials: [aTrial()],
      texts: { instructions: "# Do" },
      display: { calibrate: "off", full_screen: "off" },
    },
  } as unknown as Session;
  return JSON.stringify(timeline(session, "token")).match(/\d of \d/g) ?? [];
}

it("steps keep their numbers when the page is loaded again", () => {
  vi.stubGlobal("window", { innerWidth: 1_280, innerHeight: 800 });
  vi.stubGlobal("document", { fullscreenElement: {} });
  expect(steps(null, [])).toEqual(["1 of 3", "2 of 3", "3 of 3"]);
  expect(steps("2026-11-27", [])).toEqual(["2 of 3", "3 of 3"]);
  expect(steps("2026-11-27", ["about"])).toEqual(["3 of 3"]);
  vi.unstubAllGlobals();
});
