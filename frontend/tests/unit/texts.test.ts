import { describe, expect, it } from "vitest";
import { direction, loadMessages, pick, preferred, SHIPPED, translator } from "../../src/i18n";
import en from "../../src/i18n/languages/en.json";
import type { Message, MessageKey, Messages } from "../../src/i18n/message";
import { recruiterQuery } from "../../src/participant/flow/identity";
import { parseBlocks } from "../../src/ui/markdown";

describe("messages", () => {
  const last = (message: Message): string => (typeof message === "string" ? message : message.other);
  const holes = (text: string): string[] => [...text.matchAll(/\{(\w+)\}/g)].map(([, name]) => name ?? "").sort();
  const files = import.meta.glob<Messages>("../../src/i18n/languages/*.json", { eager: true, import: "default" });
  const translations = Object.entries(files).filter(([path]) => !path.endsWith("/en.json"));
  it.each(translations)("of %s are complete, with the holes of the English ones", (_path, messages) => {
    expect(Object.keys(messages).sort()).toEqual(Object.keys(en).sort());
    const wrong = (Object.keys(en) as MessageKey[]).filter((key) => holes(last(messages[key])).join() !== holes(last(en[key])).join());
    expect(wrong).toEqual([]);
  });
  it.each(Object.entries(files))(
    "of %s have every form that the language has for a number, with none but the English holes",
    (path, messages) => {
      const rules = new Intl.PluralRules(/(\w+)\.json$/.exec(path)?.[1]);
      const needed = [...new Set(Array.from({ length: 1_000 }, (_, number) => rules.select(number)))];
      for (const [key, message] of Object.entries(messages)) {
        if (typeof message === "string") continue;
        const { by, ...forms } = message;
        expect(Object.keys(forms), key).toEqual(expect.arrayContaining(needed));
        const known = holes(last(en[key as MessageKey]));
        expect(known, key).toContain(by);
        expect(
          Object.values(forms)
            .flatMap(holes)
            .filter((hole) => !known.includes(hole)),
          key,
        ).toEqual([]);
      }
    },
  );
  it.each(Object.entries(files))("of %s say no word twice in a row, but for French reflexives", (_path, messages) => {
    const texts = Object.values(messages).flatMap((message) => (typeof message === "string" ? [message] : Object.values(message)));
    expect(texts.filter((text) => /(?<!\p{L})(?!vous )(\p{L}+) \1(?!\p{L})/iu.test(text))).toEqual([]);
  });
  it("take the form of the number that they count", async () => {
    await Promise.all(["en", "pl", "ar", "ja"].map(loadMessages));
    const said = (tag: string, count: number): string => translator(tag)("finishing_wait", { count });
    expect(said("en", 1)).toMatch(/^1 answer still needs/);
    expect(new Set([1, 2, 5, 22].map((count) => said("pl", count).replace(/\d+/, ""))).size).toBe(3);
    expect(new Set([0, 1, 2, 3, 11, 100].map((count) => said("ar", count).replace(/\d+/, ""))).size).toBe(6);
    expect(said("ja", 1).replace("1", "2")).toBe(said("ja", 2));
  });
  it("come from every file in the folder", () => {
    expect(SHIPPED).toHaveLength(Object.keys(files).length);
    expect(SHIPPED).toContain("de");
  });
  it("are filled in, and fall back to English", async () => {
    await Promise.all(["en", "de", "fi"].map(loadMessages));
    expect(translator("de")("step", { step: 1, steps: 4 })).toBe("Schritt 1 von 4");
    expect(translator("fi")("continue")).toBe("Continue");
  });
});

describe("languages", () => {
  it("are chosen as the browser prefers", () => {
    expect(preferred(["en", "de"], ["fr", "de-AT", "en"])).toBe("de");
    expect(preferred(["en", "de"], ["fr"])).toBe("en");
    expect(pick({ en: "a", de: "b" }, "de")).toBe("b");
    expect([direction("ar"), direction("de")]).toEqual(["rtl", "ltr"]);
  });
});

describe("markdown", () => {
  it("finds headings, paragraphs and lists with lines that go on", () => {
    const blocks = parseBlocks("# Title\n\nOne\ntwo.\n\n1. First\n   goes on\n2. Second\n\n- a\n- b\n\n---");
    expect(blocks).toEqual([
      { kind: "heading", level: 1, text: "Title" },
      { kind: "paragraph", text: "One two." },
      { kind: "list", ordered: true, start: 1, items: ["First goes on", "Second"] },
      { kind: "list", ordered: false, start: 1, items: ["a", "b"] },
      { kind: "rule" },
    ]);
  });
  it("takes markup for text", () => {
    expect(parseBlocks("<script>alert(1)</script>")).toEqual([{ kind: "paragraph", text: "<script>alert(1)</script>" }]);
  });
});

it("recruiter parameters are kept, the page's own are not", () => {
  expect(recruiterQuery("?PROLIFIC_PID=abc&simulate=visual&STUDY_ID=1")).toEqual({ PROLIFIC_PID: "abc", STUDY_ID: "1" });
});
