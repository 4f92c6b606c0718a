/** Digits of every script, on every keyboard and in every field. */
import { describe, expect, it } from "vitest";
import { digitValue, plainNumber, isStartKey, keyOf } from "../../src/ui/keys";

/** The digit 0 of scripts, by hand from the Unicode charts. */
const ZEROS: Record<string, number> = {
  ascii: 0x30,
  arabic_indic: 0x660,
  persian: 0x6f0,
  devanagari: 0x966,
  bengali: 0x9e6,
  tamil: 0xbe6,
  thai: 0xe50,
  tibetan: 0xf20,
  khmer: 0x17e0,
  full_width: 0xff10,
  mathematical_bold: 0x1d7ce,
  mathematical_double_struck: 0x1d7d8,
};
const digitsOf = (zero: number): string[] => Array.from({ length: 10 }, (_, value) => String.fromCodePoint(zero + value));

describe.each(Object.entries(ZEROS))("digits: %s", (_name, zero) => {
  it("have their values", () => expect(digitsOf(zero).map(digitValue)).toEqual([0, 1, 2, 3, 4, 5, 6, 7, 8, 9]));
  it("are an age", () => expect(Number(plainNumber(` ${digitsOf(zero)[3]}${digitsOf(zero)[4]} `))).toBe(34));
  it("are a key", () => expect(keyOf({ key: digitsOf(zero)[7] ?? "", code: "", shiftKey: false })).toBe("7"));
});

describe("what is not a digit", () => {
  it.each(["", "a", "12", "²", "½", "Ⅷ", "四", "Enter"])("has no value: %s", (text) => expect(digitValue(text)).toBe(null));
  it("leaves a number that is none as it is", () => expect(Number(plainNumber("3o"))).toBeNaN());
  it("keeps signs and points", () => expect(plainNumber("\u200f−٣٫٥")).toBe("-3.5"));
});

describe("the top row", () => {
  const AZERTY = ["à", "&", "é", '"', "'", "(", "-", "è", "_", "ç"];
  const CZECH = ["é", "+", "ě", "š", "č", "ř", "ž", "ý", "á", "í"];
  it.each([
    ["AZERTY", AZERTY],
    ["Czech", CZECH],
  ])("of %s is digits", (_name, row) => {
    const keys = row.map((key, digit) => keyOf({ key, code: `Digit${digit}`, shiftKey: false }));
    expect(keys).toEqual(["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"]);
  });
  it("with Shift is what it writes", () => {
    expect(keyOf({ key: "!", code: "Digit1", shiftKey: true })).toBe("!");
    expect(keyOf({ key: "1", code: "Digit1", shiftKey: true })).toBe("1");
  });
});

describe("an input method", () => {
  it.each(["Process", "Unidentified"])("leaves keys their places: %s", (key) => {
    const at = (code: string): string => keyOf({ key, code, shiftKey: false });
    expect(["Digit5", "Numpad5", "Space", "Enter", "NumpadEnter", "ArrowLeft", "KeyY"].map(at)).toEqual([
      "5",
      "5",
      " ",
      "Enter",
      "Enter",
      "ArrowLeft",
      "y",
    ]);
    expect(isStartKey({ key, code: "Space", shiftKey: false })).toBe(true);
  });
  it("writes a wide blank", () => expect(isStartKey({ key: "　", code: "Space", shiftKey: false })).toBe(true));
  it("of another script has the letter's place, and Latin layouts their letter", () => {
    expect(keyOf({ key: "н", code: "KeyY", shiftKey: false })).toBe("y");
    expect(keyOf({ key: "z", code: "KeyY", shiftKey: false })).toBe("z");
    expect(keyOf({ key: "End", code: "Numpad1", shiftKey: false })).toBe("End");
  });
});
