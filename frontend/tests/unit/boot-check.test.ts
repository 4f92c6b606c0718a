import { readFileSync } from "node:fs";
import { runInNewContext } from "node:vm";
import { describe, expect, it } from "vitest";

const SCRIPT = readFileSync(new URL("../../src/participant/public/boot-check.js", import.meta.url), "utf8");
const OWN = "https://study.example/assets/participant/index.js";

/** A page in which the script has run, before anything else has; `storage` is what the tab keeps over reloads. */
class Opened {
  page = "";
  reports: string[] = [];
  reloads = 0;
  started = false;
  starts_meanwhile = false;
  private readonly listeners: Record<string, (event: object) => void> = {};
  private readonly later: (() => void)[] = [];

  constructor({ modules = true, storage }: { modules?: boolean; storage?: Record<string, unknown> } = {}) {
    const root = {
      getAttribute: () => (this.started ? "yes" : null),
      set innerHTML(text: string) {
        show(text);
      },
    };
    const show = (text: string): void => void (this.page = text);
    const sent = (body: string): void => void this.reports.push(body);
    const window = { addEventListener: (type: string, listener: (event: object) => void) => (this.listeners[type] = listener) };
    const page = {
      window,
      document: { createElement: () => (modules ? { noModule: false } : {}), getElementById: () => root },
      navigator: { userAgent: "test" },
      location: { pathname: "/run/abc", reload: () => (this.reloads += 1) },
      setTimeout: (work: () => void) => this.later.push(work),
      XMLHttpRequest: class {
        open(): void {}
        setRequestHeader(): void {}
        send(body: string): void {
          sent(body);
        }
      },
    };
    runInNewContext(SCRIPT, storage ? { ...page, sessionStorage: storage } : page);
  }

  /** What the browser does next: an event, and whatever was put off. */
  happens(type: string, nodeName?: string, src = OWN): this {
    this.listeners[type]?.({ target: { nodeName, src } });
    if (this.starts_meanwhile) this.started = true;
    for (const work of this.later.splice(0)) work();
    return this;
  }
}

const lose = (storage?: Record<string, unknown>): Opened => new Opened(storage && { storage }).happens("error", "SCRIPT").happens("load");

describe("a page that has not begun", () => {
  it("is loaded again where a script was lost, three times, then by hand, and is never called too old", () => {
    const storage = {};
    const opened = [1, 2, 3, 4].map(() => lose(storage));
    expect(opened.map(({ reloads }) => reloads)).toEqual([1, 1, 1, 0]);
    for (const { page, reports } of opened) {
      expect(page).toContain('The connection failed</h1><p><a href="">Reload the page');
      expect(reports).toEqual([]);
    }
    expect(lose(storage).reloads, "a reload by hand resets the count").toBe(1);
  });
  it("is not loaded again by itself where nothing can be counted", () => {
    const { page, reloads } = lose();
    expect([page.includes("The connection failed"), reloads]).toEqual([true, 0]);
  });
  it.each([
    ["knows no modules", new Opened({ modules: false })],
    ["cannot read the script", new Opened({ storage: {} }).happens("error").happens("load")],
  ])("is too old where it %s, and the server learns it", (_what, { page, reports, reloads }) => {
    expect(page).toContain("too old for the study");
    expect(reports.map((body) => JSON.parse(body) as object)).toMatchObject([{ link_token: "abc", reason: "old_browser" }]);
    expect(reloads).toBe(0);
  });
  it("is left alone where the script of somebody else was lost, and where it begins after all", () => {
    const others = new Opened({ storage: {} });
    expect(others.happens("error", "SCRIPT", "https://extension.example/extra.js")).toMatchObject({ page: "", reloads: 0 });
    const late = new Opened({ storage: {} });
    late.starts_meanwhile = true;
    expect(late.happens("error", "SCRIPT").reloads).toBe(0);
  });
  it("is left alone once it has begun, whatever is lost then", () => {
    const opened = new Opened({ storage: {} });
    opened.started = true;
    expect(opened.happens("error", "SCRIPT").happens("load")).toMatchObject({ page: "", reports: [], reloads: 0 });
  });
});
