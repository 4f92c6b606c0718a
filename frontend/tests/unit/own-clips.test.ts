import { describe, expect, it } from "vitest";
import { Refused, titleOf } from "../../src/admin/api";
import type { Data } from "../../src/admin/builder/data";
import {
  arrangementOf,
  cellsByPattern,
  factorsOf,
  filledByPattern,
  filledInOrder,
  gridProblem,
  meetingOfClips,
  type Place,
  placesToSave,
  slotsOf,
  tableOfCells,
  tableToFill,
  withMoved,
  withRenames,
} from "../../src/admin/builder/places";
import { begun, edited } from "../../src/admin/builder/history";
import { clipFindings, factsOf, pictureProblems, repeatedFiles } from "../../src/admin/clips/examine";
import { sizeRemark } from "../../src/admin/clips/UploadClips";
import { languageFindings, ranked, summaryOf } from "../../src/admin/studies/Preflight";
import { matching } from "../../src/admin/studies/StudiesPage";
import { expectedReturn, isReturn, testAddress } from "../../src/admin/studies/SelfTest";
import { nextStep, stepOf, turnedAwayHere } from "../../src/admin/studies/StatusBadge";
import {
  declaredPattern,
  factorsOfTable,
  levelsByPattern,
  levelsOfPattern,
  numbersProblem,
  patternProblem,
  reservedProblem,
  saysNothing,
  unnamedFactors,
  withNames,
} from "../../src/admin/studies/file-pattern";

const FILES = ["rosie_slow_1.mp4", "hal_slow_1.webm", "hal_fast_2.mp4"];

describe("the grid of a new study", () => {
  const clips = ["IMG_2.mov", "IMG_10.mov", "IMG_1.mov", "IMG_3.mov"].map((file): Place => ({
    clip_sha256: `sha of ${file}`,
    file,
    levels: {},
    exemplar: 0,
    upload: "u",
  }));
  const typed = (...factors: [string, string][]) => ({ factors: factors.map(([name, levels]) => ({ name, levels })), places: clips });

  it("is filled in order of the file names, cells by rows", () => {
    const cells = typed(["Robot type", "tin, rosie"], ["speed", " slow ,very fast,slow,"]);
    expect(gridProblem(cells)).toBe("a cell for each clip");
    const full = { ...cells, places: filledInOrder(cells) };
    expect(gridProblem(full)).toBe(false);
    expect(tableOfCells(full).split("\n")).toEqual([
      '"file","Robot_type","speed","exemplar"',
      '"IMG_1.mov","tin","slow","1"',
      '"IMG_2.mov","tin","very fast","1"',
      '"IMG_3.mov","rosie","slow","1"',
      '"IMG_10.mov","rosie","very fast","1"',
    ]);
  });

  it("has as many places in each cell as the clips fill, and names what is wrong", () => {
    const two = typed(["speed", "slow, fast"]);
    expect(slotsOf({ factors: [], exemplars: {} })).toEqual([]);
    expect(
      arrangementOf(filledInOrder(two), {
        factors: [{ name: "speed", levels: [{ name: "slow" }, { name: "fast" }] }],
        exemplars: { per_cell: 2 },
      }).rest,
    ).toEqual([]);
    const odd = typed(["speed", "slow, normal, fast"]);
    expect(gridProblem({ ...odd, places: filledInOrder(odd) })).toBe("a clip for each place of the grid, or other levels");
    expect(gridProblem(typed(["", "slow"]))).toBe("what varies between the clips with its levels");
    expect(gridProblem(typed(["a", "x, y"], ["a", "z, w"]))).toBe("another name for each factor");
    expect(gridProblem({ ...typed(["response", "x, y"]), places: filledInOrder(typed(["response", "x, y"])) })).toContain(
      "other than ‘response’",
    );
  });

  it("needs a name and levels of each factor that is begun, and none that the table has for itself", () => {
    const filled = (...factors: [string, string][]) => gridProblem({ ...typed(...factors), places: filledInOrder(typed(...factors)) });
    expect(filled(["speed", "slow, fast"], ["", ""])).toBe(false);
    expect(filled(["speed", "slow, fast"], ["", "tin, rosie"])).toBe("a name for tin, rosie");
    expect(filled(["speed", "slow, fast"], ["robot", " , "])).toBe("levels of robot");
    expect(filled(["exemplar", "slow, fast"])).toContain("other than ‘exemplar’");
    expect(filled(["file", "slow, fast"])).toContain("other than ‘file’");
    expect(filled(["speed", "slow, f/st"])).toBe("a level without a slash in the place of f/st");
  });

  it("takes names that every object has", () => {
    const cells = typed(["constructor", "tin, rosie"], ["__proto__", "toString, valueOf"]);
    expect(tableOfCells({ ...cells, places: filledInOrder(cells) }).split("\n")[1]).toBe('"IMG_1.mov","tin","toString","1"');
    expect(withNames("{constructor}_{toString}.mp4", {})).toBe("{constructor}_{toString}.mp4");
    const read = filledByPattern([...clips, { ...clips[0], file: "a_b.mp4" } as Place], {}, "{constructor}_{valueOf}.mp4");
    expect(factorsOf(read.data)).toEqual([
      { name: "constructor", levels: ["a", "IMG"] },
      { name: "valueOf", levels: ["b", "1", "2", "3", "10"] },
    ]);
  });

  it("may also be a table, whose first column has every name whole", () => {
    expect(tableToFill(["a.mp4", "left, up.mp4", '5".mp4'])).toBe('file,factor\na.mp4,\n"left, up.mp4",\n"5"".mp4",');
  });

  it("begins with what a pattern reads", () => {
    const places = FILES.map((file): Place => ({ clip_sha256: file, file, levels: {}, exemplar: 0, upload: "u" }));
    const cells = cellsByPattern(places, "{robot}_{speed}_{exemplar}.mp4");
    expect(cells.factors).toEqual([
      { name: "robot", levels: "hal, rosie" },
      { name: "speed", levels: "fast, slow" },
    ]);
    expect(cellsByPattern(places, "").factors).toEqual([{ name: "", levels: "" }]);
  });
});

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

  it("say nothing where they only number the clips", () => {
    expect(saysNothing("IMG_{factor1}.mp4", ["IMG_4031.mov", "IMG_4032.mkv"])).toBe(true);
    expect(saysNothing("{exemplar}.mp4", ["1.mp4", "2.mp4"])).toBe(true);
    expect(saysNothing("", ["a.mp4"])).toBe(true);
    expect(saysNothing("{speed}.mp4", ["slow.mp4", "fast.mp4"])).toBe(false);
    expect(saysNothing("{factor1}.mp4", ["calm.mp4", "wild.mp4"])).toBe(false);
    expect(saysNothing("blink_{factor1}.mp4", ["blink_50.mp4", "blink_75.mp4", "blink_100.mp4"])).toBe(false);
    expect(saysNothing("{factor1}_{factor2}.mp4", ["a_b.mp4", "c_d.mp4"])).toBe(false);
  });

  it("of a threshold have a factor of at least four numbers", () => {
    const files = ["50", "75", "100", "1e2", "150"].map((speed) => `smile_${speed}_anna.mp4`);
    expect(numbersProblem(levelsOfPattern("smile_{speed}_{who}.mp4", files))).toBe(false);
    expect(numbersProblem(levelsOfPattern("smile_{speed}_{who}.mp4", files.slice(0, 4)))).toContain("at least 4 levels");
    expect(numbersProblem([["slow", "fast", "1", "2", "3"]])).toContain("numbers");
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

  it("take names as somebody types them, and skip taken names and what is not a name", () => {
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

  it("do not matter where all are the same, or not known", () => {
    expect(sizeRemark([wide("a.mp4"), wide("b.mp4"), { name: "c.mp4", width_px: null, height_px: null }])).toBeNull();
    expect(sizeRemark([])).toBeNull();
  });
});

describe("what the frames of a clip show", () => {
  const plain = (level: number) => Array.from({ length: 64 }, (_, at) => (at % 4 === 3 ? 255 : level));
  const striped = (level: number) => plain(level).map((value, at) => (at % 4 !== 3 && at % 8 < 4 ? value + 40 : value));
  const kinds = (...samples: number[][]) => pictureProblems(samples).map(({ kind }) => kind);

  it("is nothing where every frame has one color, and nothing at first where the first one has", () => {
    expect(kinds(plain(10), plain(90), plain(200))).toEqual(["blank"]);
    expect(kinds(plain(10), striped(90), striped(120))).toEqual(["begins_blank"]);
  });

  it("is not motion where all frames are the same but for the noise of a codec, or where there is one", () => {
    expect(kinds(striped(90), striped(92), striped(89))).toEqual(["still"]);
    expect(kinds(striped(90))).toEqual(["still"]);
    expect(kinds(striped(90), striped(91), striped(130))).toEqual([]);
  });
});

describe("the checklist", () => {
  const finding = (kind: string, blocks = false) => ({ kind, blocks, text: kind, page: "build" as const, path: "" });

  it("has one line for each kind of problem with the first files", () => {
    const clips = ["a", "b", "c", "d", "e"].map((name) => ({
      file: `${name}.mp4`,
      problems: [{ kind: "undecodable" as const, detail: "no track" }],
    }));
    const [line, ...others] = clipFindings([...clips, { file: "f.mp4", problems: [] }]);
    expect(others).toEqual([]);
    expect(line?.blocks).toBe(true);
    expect(line?.text).toBe(
      "5 clips do not play in the participant page: a.mp4 (no track), b.mp4 (no track), c.mp4 (no track), d.mp4 (no track), e.mp4 (no track). Export the clip again as H.264 in MP4.",
    );
  });

  it("names cells that show the same file, but not exemplars of one cell that do", () => {
    const clip = (clip_sha256: string, cell: string) => ({ clip_sha256, cell, file: `${clip_sha256}.mp4` });
    expect(repeatedFiles([clip("1", "a"), clip("1", "a"), clip("2", "b")])).toEqual([]);
    const [line] = repeatedFiles([clip("1", "a"), clip("1", "b"), clip("2", "b")]);
    expect(line?.text).toContain("1 clip is the same file in several cells: a and b.");
    expect(line?.blocks).toBe(false);
  });

  it("says what the clips have in common, or how far they differ", () => {
    const clip = (clip_sha256: string, frames: number, fps = 30) => ({ clip_sha256, frames, fps, width_px: 960, height_px: 360 });
    expect(factsOf([clip("1", 45), clip("2", 45)])).toBe("2 clips: 1.50 s, 960 x 360 pixels, 30 frames per second");
    expect(factsOf([clip("1", 45), clip("2", 60, 29.97)])).toBe(
      "2 clips: 1.50 to 2.00 s, 960 x 360 pixels, 29.97 to 30.00 frames per second",
    );
  });

  it("counts what keeps a study from going live apart from what is to be checked", () => {
    expect(summaryOf([])).toBe("Nothing prevents going live.");
    expect(summaryOf([finding("a")])).toBe("1 thing to check. None of them prevents going live.");
    expect(summaryOf([finding("a", true), finding("b", true), finding("c")])).toBe("2 to fix before it goes live, 1 to check.");
  });

  it("lists what stops a study first, then what spoils answers, and names the checks that found nothing", () => {
    const of = (kind: string, blocks = false) => ({ kind, blocks, text: kind, page: "clips" as const, path: "" });
    const { fix, look, fine } = ranked([of("backups"), of("plan"), of("clip_still"), of("contact"), of("placeholders", true)]);
    expect(fix.map(({ kind }) => kind)).toEqual(["placeholders"]);
    expect(look.map(({ kind }) => kind)).toEqual(["clip_still", "contact", "plan", "backups"]);
    expect(fine).toContain("Rehearsal");
    expect(fine).not.toContain("Backups");
  });

  it("names languages in which the page has no words, or unreviewed ones", () => {
    expect(languageFindings(["en"])).toEqual([]);
    expect(languageFindings(["en", "de-AT", "tlh"]).map(({ text }) => text)).toEqual([
      expect.stringContaining("in English for"),
      expect.stringContaining("not been reviewed by a native speaker"),
    ]);
  });
});

describe("the list of studies", () => {
  it("is searched by every word of title, name, owner and workspace", () => {
    const row = (title: string, name: string, owner: string) => ({ title, name, owner, workspace: "lab" });
    const rows = [row("Lower lids", "exp3", "Ada"), row("Blink timing", "timing", "Grace")];
    const names = (search: string) => matching(rows, search).map(({ name }) => name);
    expect(names("")).toEqual(["exp3", "timing"]);
    expect(names(" ada LIDS ")).toEqual(["exp3"]);
    expect(names("ada timing")).toEqual([]);
    expect(names("lab")).toEqual(["exp3", "timing"]);
  });
});

describe("the next step of a study", () => {
  const study = { status: "draft" as const, paused: false, archived_at: null, complete: 3, quota: null };
  const check = (kind: string, blocks = false) => ({ kind, blocks, text: "", page: "build" as const, path: "" });

  it("is to fix what blocks, to preview, to rehearse, then to open it", () => {
    const all = [check("placeholders", true), check("not_tried"), check("rehearsal")];
    expect(nextStep(study, all)).toEqual({ step: "draft", text: "Fix 1 problem on the checklist.", page: "" });
    expect(nextStep(study, all.slice(1))).toMatchObject({ step: "preview", text: expect.stringContaining("Preview") as string });
    expect(nextStep(study, all.slice(2))).toMatchObject({ step: "rehearsal", page: "/rehearsal" });
    expect(nextStep(study, [])).toMatchObject({ step: "pilot", text: expect.stringContaining("pilot") as string });
  });

  it("follows the status afterwards", () => {
    expect(nextStep({ ...study, status: "pilot" }, []).page).toBe("/results");
    expect(nextStep({ ...study, status: "live", quota: 20 }, []).text).toBe("Follow the participants on the monitor (3 of 20 complete).");
    expect(nextStep({ ...study, status: "live", paused: true }, []).page).toBe("/settings");
    expect(nextStep({ ...study, status: "closed" }, [])).toMatchObject({ step: "live", page: "/data" });
    // Also before the checklist has come: the last step is then called Closed.
    expect([stepOf("draft"), stepOf("closed")]).toEqual(["draft", "live"]);
    expect(nextStep({ ...study, archived_at: "2026-01-01" }, []).page).toBe("/settings");
  });
});

describe("clips in the cells of a study", () => {
  const level = (name: string) => ({ name, label: name });
  const data = { factors: [{ name: "speed", levels: [level("slow"), level("fast")] }], exemplars: { per_cell: 1 } };
  const clip = (file: string, speed: string, exemplar = 1): Place => {
    return { clip_sha256: file, file, levels: { speed }, exemplar, upload: null };
  };
  const [slow, fast] = [clip("a.mp4", "slow"), clip("b.mp4", "fast")];
  const files = (places: readonly Place[], of: Data = data) => arrangementOf(places, of).filled.map((one) => one.clip?.file ?? null);

  it("change places, and are out of a cell that they are taken from", () => {
    const [first, second] = slotsOf(data);
    expect(files(withMoved([slow, fast], data, slow, second ?? null))).toEqual(["b.mp4", "a.mp4"]);
    const out = withMoved([slow, fast], data, slow, null);
    expect(files(out)).toEqual([null, "b.mp4"]);
    expect(files(withMoved(out, data, fast, first ?? null))).toEqual(["b.mp4", null]);
    expect(placesToSave(out, data)).toEqual([{ clip_sha256: "b.mp4", file: "b.mp4", levels: { speed: "fast" }, exemplar: 1 }]);
  });

  it("follow a level and a factor to another name, and no level that came", () => {
    const renamed = { factors: [{ name: "tempo", levels: [level("calm"), level("fast")] }], exemplars: { per_cell: 1 } };
    expect(files(withRenames([slow, fast], data, renamed), renamed)).toEqual(["a.mp4", "b.mp4"]);
    const more = { ...data, factors: [{ name: "speed", levels: [level("new"), level("slow"), level("fast")] }] };
    const places = [slow, fast];
    expect(withRenames(places, data, more)).toBe(places);
    expect(files(places, more)).toEqual([null, "a.mp4", "b.mp4"]);
    const other = { ...data, factors: [{ name: "speed", levels: [level("fast"), level("slow")] }] };
    expect(withRenames(places, data, other)).toBe(places);
  });

  it("are filled from the names of files, with factors that are new", () => {
    const names = ["rosie_fast_1.mp4", "rosie_fast_2.mp4", "rosie_slow_1.mp4", "rosie_slow_2.mp4", "odd.mp4"];
    const filled = filledByPattern(
      names.map((name) => clip(name, "slow", 0)),
      data,
      "{robot}_{speed}_{exemplar}.mp4",
    );
    expect(factorsOf(filled.data)).toEqual([
      { name: "speed", levels: ["slow", "fast"] },
      { name: "robot", levels: ["rosie"] },
    ]);
    expect(files(filled.places, filled.data)).toEqual(["rosie_slow_1.mp4", "rosie_slow_2.mp4", "rosie_fast_1.mp4", "rosie_fast_2.mp4"]);
    expect(arrangementOf(filled.places, filled.data).rest.map(({ file }) => file)).toEqual(["odd.mp4"]);
  });
});

describe("clips filled from names", () => {
  const level = (name: string) => ({ name, label: name });
  const data = {
    factors: [
      { name: "robot", levels: [level("rosie")] },
      { name: "speed", levels: [level("slow"), level("fast")] },
    ],
    exemplars: { per_cell: 1 },
  };
  const clip = (file: string, speed = "slow", exemplar = 0): Place => {
    return { clip_sha256: file, file, levels: { robot: "rosie", speed }, exemplar, upload: null };
  };
  const filled = (names: readonly string[], others: readonly Place[] = []) =>
    filledByPattern([...others, ...names.map((name) => clip(name))], data, "{speed}_{robot}_{exemplar}.mp4");
  const cellsOf = ({ data: own, places }: ReturnType<typeof filled>) =>
    arrangementOf(places, own).filled.flatMap((one) => (one.clip === null ? [] : [[one.slot.name, one.clip.file]]));

  it("leave the declared order of factors, and have the numbers of their names", () => {
    const next = filled(["slow_rosie_2.mp4", "fast_rosie_1.mp4", "fast_rosie_2.mp4"]);
    expect(factorsOf(next.data).map(({ name }) => name)).toEqual(["robot", "speed"]);
    expect(cellsOf(next)).toEqual([
      ["rosie/slow, no. 2", "slow_rosie_2.mp4"],
      ["rosie/fast, no. 1", "fast_rosie_1.mp4"],
      ["rosie/fast, no. 2", "fast_rosie_2.mp4"],
    ]);
    expect(cellsOf(filled(["slow_rosie_0.mp4", "slow_rosie_7.mp4"])).map(([name]) => name)).toEqual([
      "rosie/slow, no. 1",
      "rosie/slow, no. 2",
    ]);
  });

  it("come before one that does not fit and was in the place", () => {
    const next = filled(["slow_rosie_1.mp4"], [clip("a stray.mp4", "slow", 1), clip("another.mp4", "fast", 1)]);
    expect(cellsOf(next)).toEqual([
      ["rosie/slow, no. 1", "slow_rosie_1.mp4"],
      ["rosie/fast, no. 1", "another.mp4"],
    ]);
  });

  it("may be as many in a cell as the server takes", () => {
    expect(slotsOf({ ...data, exemplars: { per_cell: 300 } })).toHaveLength(600);
    expect(slotsOf({ ...data, exemplars: { per_cell: 5000 } })).toHaveLength(2000);
  });

  it("keep their level while its name passes through that of another", () => {
    const stored = [clip("a.mp4", "slow", 1), clip("b.mp4", "fast", 1)];
    const typed = (words: readonly string[], pause: number) =>
      words.reduce(
        (history, word, index) => edited(history, ["factors", 1, "levels", 0, "name"], word, index * pause, data, stored),
        begun(data, "", null),
      ).now;
    for (const pause of [10, 10_000]) {
      const now = typed(["slo", "f", "fas", "fast", "fast-", "fast-ish"], pause);
      expect(arrangementOf(now.places ?? stored, now.data).filled.map((one) => one.clip?.file)).toEqual(["a.mp4", "b.mp4"]);
    }
  });
});

describe("clips that two people moved", () => {
  const level = (name: string) => ({ name, label: name });
  const named = (...names: string[]) => ({ factors: [{ name: "speed", levels: names.map(level) }], exemplars: { per_cell: 1 } });
  const base = named("s1", "s2", "s3", "s4");
  const stored = (cells: Record<string, string>): Place[] =>
    Object.entries(cells).map(([file, speed]): Place => {
      const at = { levels: { speed }, exemplar: speed === "" ? 0 : 1 };
      return { clip_sha256: file, file, ...at, upload: null, from: at };
    });
  const before = stored({ a: "s1", b: "s2", c: "s3", d: "s4" });
  const moved = (from: readonly Place[], cells: Record<string, string>) =>
    from.map((one) => ({ ...one, levels: { speed: cells[one.file] ?? "" }, exemplar: 1 }));
  const cellsOf = (places: readonly Place[]) =>
    Object.fromEntries(places.map(({ file, levels, exemplar }) => [file, exemplar === 0 ? "" : levels["speed"]]));
  const same = { base, mine: base, theirs: base };

  it("keep moves that only one of them made", () => {
    const mine = moved(before, { a: "s2", b: "s1", c: "s3", d: "s4" });
    const met = meetingOfClips(mine, stored({ a: "s1", b: "s2", c: "s4", d: "s3" }), same);
    expect(cellsOf(met.places)).toEqual({ a: "s2", b: "s1", c: "s4", d: "s3" });
    expect([met.both, [...met.theirs].sort()]).toEqual([[], ["c", "d"]]);
    // What both moved alike, and a version in which no clip moved.
    expect(meetingOfClips(mine, stored({ a: "s2", b: "s1", c: "s3", d: "s4" }), same).both).toEqual([]);
    expect(cellsOf(meetingOfClips(mine, before, same).places)).toEqual(cellsOf(mine));
  });

  it("are named where both moved one, and are where the version has them until I choose mine", () => {
    const mine = moved(before, { a: "s2", b: "s1", c: "s3", d: "s4" });
    const met = meetingOfClips(mine, stored({ a: "s3", b: "s2", c: "s1", d: "s4" }), same);
    expect(met.both).toContain("a");
    expect(cellsOf(met.places)).toEqual({ a: "s3", b: "s2", c: "s1", d: "s4" });
    expect(cellsOf(met.mine)).toEqual({ a: "s2", b: "s1", c: "s3", d: "s4" });
    // The next meeting begins from where the version has them.
    expect(met.mine.find(({ file }) => file === "a")?.from?.levels).toEqual({ speed: "s3" });
  });

  it("follow levels that either renamed, and lose clips that are no longer in the study", () => {
    const mine = moved(before, { a: "s2", b: "s1", c: "s3", d: "s4" });
    const theirs = named("s1", "s2", "third", "s4");
    const met = meetingOfClips(mine, stored({ a: "s1", b: "s2", c: "third", d: "s4" }), { base, mine: base, theirs });
    expect([cellsOf(met.places), met.both]).toEqual([{ a: "s2", b: "s1", c: "third", d: "s4" }, []]);
    const without = meetingOfClips(mine, stored({ a: "s1", b: "s2", c: "s3", e: "s4" }), same);
    expect(cellsOf(without.places)).toEqual({ a: "s2", b: "s1", c: "s3", e: "s4" });
  });

  it("are named where two are after one place", () => {
    const [upload] = moved(stored({ u: "" }), { u: "s4" });
    const mine = [...before.map((one) => (one.file === "d" ? { ...one, exemplar: 0 } : one)), { ...upload, upload: "up" } as Place];
    const met = meetingOfClips(mine, stored({ a: "s1", b: "s2", c: "s4", d: "s3" }), same);
    expect(met.both).toEqual(expect.arrayContaining(["u", "c", "d"]));
    expect(cellsOf(met.places)).toMatchObject({ c: "s4", d: "s3", u: "" });
    expect(cellsOf(met.mine)).toMatchObject({ c: "s3", d: "", u: "s4" });
  });
});

it("the way back of a recruiter has the code, the id and any run", () => {
  const recruiter = { kind: "sona", redirect_url: "https://x.org/a?c={code}&id={survey_code}&r={run}" };
  const parameters = new URL(testAddress("https://here/run/T", recruiter)).searchParams;
  const expected = expectedReturn(recruiter, "C D", parameters);
  expect(isReturn("https://x.org/a?c=C%20D&id=selftest&r=0123abcd", expected)).toBe(true);
  expect(isReturn("https://x.org/a?c=OTHER&id=selftest&r=0123abcd", expected)).toBe(false);
  expect(isReturn("https://x.org/a?c=C%20D&id=selftest&r=1&more=2", expected)).toBe(false);
  expect(expectedReturn({ kind: "prolific" }, "C", parameters)).toBe("https://app.prolific.com/submissions/complete?cc=C");
  expect(expectedReturn({ kind: "mturk" }, "C", parameters)).toBe("");
});

it("a refusal is headed by what was refused, a fault by that alone", () => {
  expect(titleOf(new Refused(409, "still_preparing", "Wait."))).toBe("Still preparing");
  expect(titleOf(new Refused(422, "weak_password", "Longer."))).toBe("Weak password");
  expect(titleOf(new Refused(409, "conflict", "Wait."))).toBe("Not possible at the moment");
  expect(titleOf(new Refused(500, "internal", "A fault."))).toBe("Something went wrong");
  expect(titleOf(new Error("x is undefined"))).toBe("Something went wrong");
});

describe("the devices that a study turns away", () => {
  it("does not send somebody to the page that she is on", () => {
    const said = "Phones cannot be used: a phone has about 390 x 600.";
    expect(turnedAwayHere(`${said} To change the minimum width and height, see Screen and playback.`)).toBe(said);
    const touch = "Phones and tablets cannot be used: the study does not allow devices with a touch screen and no mouse.";
    expect(turnedAwayHere(touch)).toBe(touch);
  });
});
