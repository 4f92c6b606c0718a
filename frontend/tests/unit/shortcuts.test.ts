/** Whose a key is: the page's, or what has the focus. */
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { isOwnKey } from "../../src/admin/ui/page-events";

/** An element that lies in one of this tag or role. */
class Focused extends EventTarget {
  constructor(private readonly inside: string) {
    super();
  }

  closest(selectors: string): Focused | null {
    return selectors.split(", ").includes(this.inside) ? this : null;
  }
}

beforeEach(() => vi.stubGlobal("Element", Focused));
afterEach(() => vi.unstubAllGlobals());

describe("keys of a page", () => {
  it.each(["button", "a", "[role=button]", "summary"])("leave Space and Enter to %s, and no other key", (name) => {
    const focused = new Focused(name);
    expect(isOwnKey(" ", focused)).toBe(true);
    expect(isOwnKey("Enter", focused)).toBe(true);
    expect(isOwnKey("ArrowLeft", focused)).toBe(false);
    expect(isOwnKey("n", focused)).toBe(false);
  });

  it.each(["input", "textarea", "select", "[contenteditable]", "[role=dialog]"])("rest in %s", (name) => {
    for (const key of [" ", "ArrowLeft", "n"]) expect(isOwnKey(key, new Focused(name))).toBe(true);
  });

  it("are the page's elsewhere", () => {
    for (const key of [" ", "Enter", "ArrowUp"]) {
      expect(isOwnKey(key, new Focused("main"))).toBe(false);
      expect(isOwnKey(key, null)).toBe(false);
    }
  });
});
