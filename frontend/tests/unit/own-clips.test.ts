import { describe, expect, it } from "vitest";
import { sizeRemark } from "../../src/admin/clips/UploadClips";
import {
  declaredPattern,
  factorsOfTable,
  levelsByPattern,
  patternProblem,
  reservedProblem,
  unnamedFactors,
  withNames,
} from "../../src/admin/studies/file-pattern";

const FILES = ["rosie_slow_1.mp4", "hal_slow_1.webm", "hal_fast_2.mp4"];

describe("levels by the names of files", () => {
  it("are shown of every file, those that do not fit first", () => {
    const read = levelsByPattern("{robot}_{speed}_{exemplar}.mp4", [...FILES, "notes.mp4"]);
    expect(read.map(({ file }) => file)).toEqual(["notes.mp4", ...FILES]);
    expect(read.map(({ levels }) => levels)).toEqual([null, ["rosie", "slow", "1"], ["hal", "slow", "1"], ["hal", "fast", "2"]]);
  });

  it("fit whichever way an accent is written", () => {
    expect(levelsByPattern("Ärm_{side}.mp4".normalize("NFD"), ["Ärm_links.mp4"])).toEqual([{ file: "Ärm_links.mp4", levels: ["links"] }]);
  });

  it("need a factor, and a pattern that every name fits", () => {
    expect(patternProblem("", FILES)).toContain("such as {speed}");
    expect(patternProblem("{exemplar}.mp4", FILES)).toContain("such as {speed}");
    expect(patternProblem("{robot}_{speed}_{exemplar}.mp4", [...FILES, "notes.mp4"])).toContain("notes.mp4 does not");
    expect(patternProblem("{robot}_{speed}_{exemplar}.mp4", FILES)).toBe(false);
  });

  it("of a study that is there are known by its own levels, also for one clip alone", () => {
    const factor = (name: string, ...levels: string[]) => ({ name, levels: levels.map((level) => ({ name: level })) });
    const factors = [factor("robot", "rosie", "tin"), factor("speed", "slow", "fast")];
    expect(declaredPattern(factors, ["rosie_slow_1.mp4"])).toBe("{robot}_{speed}_{exemplar}.mp4");
    expect(declaredPattern(factors, ["tin-fast.webm"])).toBe("{robot}-{speed}.mp4");
    expect(declaredPattern(factors, ["rosie_slow_1.mp4", "rosie_quick_1.mp4"])).toBe("");
    expect(declaredPattern(factors, [])).toBe("");
  });

  it("are refused before a study is made where a factor has the name of a column of the answers", () => {
    for (const name of ["method", "value", "kind", "series"]) {
      expect(patternProblem(`{${name}}_{exemplar}.mp4`, ["a_1.mp4"])).toContain(`${name}_shown`);
      expect(reservedProblem(factorsOfTable(`file;${name};exemplar\na_1.mp4;a;1`))).toContain(`${name}_shown`);
    }
    expect(reservedProblem(factorsOfTable("file,speed,exemplar"))).toBe(false);
    expect(patternProblem(withNames("{factor1}_{exemplar}.mp4", { factor1: "Method" }), ["a_1.mp4"])).toBe(false);
    expect(patternProblem(withNames("{factor1}_{exemplar}.mp4", { factor1: "method" }), ["a_1.mp4"])).toContain("method_shown");
  });

  it("ask what a factor without a name is", () => {
    expect(unnamedFactors("{factor1}_{speed}_{exemplar}.mp4", FILES)).toEqual([{ field: "factor1", levels: ["rosie", "hal"] }]);
  });

  it("take names as somebody types them, and leave what is no name or taken", () => {
    const pattern = "{factor1}_{factor2}_{exemplar}.mp4";
    expect(withNames(pattern, { factor1: "Robot type", factor2: "Größe" })).toBe("{Robot_type}_{Grosse}_{exemplar}.mp4");
    expect(withNames(pattern, { factor1: "speed", factor2: "speed" })).toBe("{speed}_{factor2}_{exemplar}.mp4");
    expect(withNames(pattern, { factor1: "exemplar", factor2: "12" })).toBe(pattern);
  });
});

describe("sizes of clips", () => {
  const wide = (name: string) => ({ name, width_px: 640, height_px: 360 });

  it("are remarked where one is upright among others", () => {
    expect(sizeRemark([wide("a.mp4"), { name: "b.mp4", width_px: 360, height_px: 640 }, wide("c.mp4")])).toBe(
      "b.mp4 is 360 x 640 pixels, most are 640 x 360. Is one rotated incorrectly? Participants will notice the size difference. Is this intended?",
    );
  });

  it("are not said to be those of most where they are half of them", () => {
    const small = (name: string) => ({ name, width_px: 320, height_px: 240 });
    expect(sizeRemark([wide("a.mp4"), small("b.mp4"), wide("c.mp4"), small("d.mp4")])).toContain("others are 640 x 360");
  });

  it("are no matter where all are one, or not known", () => {
    expect(sizeRemark([wide("a.mp4"), wide("b.mp4"), { name: "c.mp4", width_px: null, height_px: null }])).toBeNull();
    expect(sizeRemark([])).toBeNull();
  });
});
