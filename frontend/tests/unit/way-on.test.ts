import { afterEach, beforeEach, expect, it, vi } from "vitest";

import { choose } from "../../src/participant/screens/support";
import type { Session } from "../../src/participant/session";

const page = new EventTarget();
const WINDOW_PX = 800;

beforeEach(() => {
  vi.stubGlobal("Element", AButton);
  vi.stubGlobal("window", Object.assign(new EventTarget(), { innerHeight: WINDOW_PX }));
  vi.stubGlobal("document", Object.assign(page, { querySelector: () => null, createElement: () => new AButton() }));
});
afterEach(() => vi.unstubAllGlobals());

let bottom = 0;

class AButton extends EventTarget {
  append(): void {}
  setAttribute(): void {}
  getBoundingClientRect(): { bottom: number } {
    return { bottom };
  }
  click(): void {
    this.dispatchEvent(new Event("click"));
  }
}

/** What a page of these choices answers to a press of the key; null where it stays. */
async function answer(key: string, labels: string[], space?: "never"): Promise<string | null> {
  const session = { over: new AbortController() } as unknown as Session;
  const choices = labels.map((label) => ({ label, value: label }));
  const chosen = choose(session, { append: () => {} } as unknown as HTMLElement, choices, space);
  page.dispatchEvent(Object.assign(new Event("keydown", { cancelable: true }), { key }));
  const answered = await Promise.race([chosen, new Promise<null>((resolve) => setTimeout(() => resolve(null)))]);
  session.over.abort();
  return answered;
}

it("Space and Enter press a page's one button", async () => {
  bottom = WINDOW_PX;
  expect([await answer(" ", ["go on"]), await answer("Enter", ["go on"])]).toEqual(["go on", "go on"]);
});

it("Space scrolls to a button that is below the window, and takes none of several", async () => {
  bottom = WINDOW_PX;
  expect([await answer(" ", ["one", "other"]), await answer("Enter", ["one", "other"])]).toEqual([null, "one"]);
  bottom = WINDOW_PX + 1;
  expect(await answer(" ", ["go on"])).toBeNull();
});

it("Space does not skip a break, and Enter ends it", async () => {
  bottom = WINDOW_PX;
  expect([await answer(" ", ["go on"], "never"), await answer("Enter", ["go on"], "never")]).toEqual([null, "go on"]);
});
