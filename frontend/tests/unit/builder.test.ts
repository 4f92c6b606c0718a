import { execFileSync } from "node:child_process";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { describe, expect, it } from "vitest";
import declared from "../../src/api/declaration.json";
import { CONSENTS, FORMS, inLanguages, unfilledMarks, withKnown } from "../../src/admin/builder/bank";
import {
  type Data,
  freeName,
  isTable,
  labelOf,
  listAt,
  type Path,
  singularOf,
  valueAt,
  storedName,
  withDerivedName,
  withFirstFactor,
  withMoved,
  withValue,
  suggestionsFor,
} from "../../src/admin/builder/data";
import {
  begun,
  changesBetween,
  edited,
  latestToml,
  meetingOf,
  placeName,
  redone,
  undone,
  withChange,
  written,
} from "../../src/admin/builder/history";
import { sentenceOf } from "../../src/admin/studies/CompareVersions";
import {
  BASIC,
  type Editor,
  editorOf,
  effectOf,
  EXPERIMENT,
  isBasic,
  resolved,
  TUCKED,
  withoutNull,
  type Schema,
  starter,
  starterOf,
  helpOf,
  SECTIONS,
} from "../../src/admin/builder/schema";
import { shownClips } from "../../src/admin/kinds";

const repository = fileURLToPath(new URL("../../../", import.meta.url));
const python = ["bin/python", "Scripts/python.exe"].map((name) => join(repository, ".venv", name)).find(existsSync);

/** Every key below `schema` with its editor, once. */
function* editors(schema: Schema, path: string, seen = new Set<string>()): Generator<[string, Editor]> {
  const editor = editorOf(schema);
  if (path !== "") yield [path, editor];
  if (seen.has(path)) return;
  seen.add(path);
  if (editor.kind === "table") for (const [name, inner] of editor.keys) yield* editors(inner, path === "" ? name : `${path}.${name}`, seen);
  if (editor.kind === "elements" || editor.kind === "languages") yield* editors(editor.of, `${path}[]`, seen);
  if (editor.kind === "variants")
    for (const [tag, inner] of Object.entries(editor.variants)) yield* editors(inner, `${path}<${tag}>`, seen);
}

describe("the declaration's schema", () => {
  it("has an editor for every key", () => {
    const all = [...editors(EXPERIMENT, "")];
    expect(all.length).toBeGreaterThan(120);
    expect(all.filter(([, editor]) => editor.kind === "raw").map(([path]) => path)).toEqual([]);
  });

  it("has a table for each language wherever it has something for each, and names hold texts or numbers", () => {
    const all = new Map(editors(EXPERIMENT, ""));
    const odd = [...all].filter(([, editor]) => editor.kind === "languages" && editorOf(editor.of).kind !== "table");
    expect(odd.map(([path]) => path)).toEqual([]);
    expect(all.get("groups.quotas")).toEqual({ kind: "dictionary", of: "number" });
    expect(all.get("groups.answers")).toEqual({ kind: "dictionary", of: "text" });
  });

  it("has help for every key", () => {
    const tables = [EXPERIMENT, ...Object.values(EXPERIMENT.$defs ?? {})];
    const keys = tables.flatMap((table) => Object.entries(table.properties ?? {}));
    expect(keys.filter(([, key]) => !key.description).map(([name]) => name)).toEqual([]);
  });

  it("is on the pages of the builder, each key once", () => {
    const shown = SECTIONS.flatMap(({ keys }) => keys).filter((key) => key in (EXPERIMENT.properties ?? {}));
    expect(shown.toSorted()).toEqual(Object.keys(EXPERIMENT.properties ?? {}).toSorted());
  });

  it("says what an edit does to the data", () => {
    expect(effectOf("trial.scale.question", "clip_rating")).toBe("measured");
    expect(effectOf("texts.en.debrief", "clip_rating")).toBe("wording");
    expect(Object.keys(declared.trial_effects)).toContain("clip_rating");
  });
});

/** Builds `expected` as somebody would in the forms: one key after the other, each by the editor that it has. */
function built(data: unknown, schema: Schema, path: Path, expected: unknown): unknown {
  const editor = editorOf(schema);
  const languages = ["en", "de"];
  switch (editor.kind) {
    case "table":
      return Object.entries(expected as Data).reduce(
        (made, [name, value]) => {
          const inner = editor.keys.find(([key]) => key === name)?.[1];
          if (inner === undefined) throw new Error(`no editor for ${[...path, name].join(".")}`);
          return built(made, inner, [...path, name], value);
        },
        isTable(valueAt(data, path)) ? data : withValue(data, path, {}),
      );
    case "variants": {
      const named = (expected as Data)[editor.tag];
      const tag = typeof named === "string" ? named : (Object.keys(editor.variants)[0] ?? "");
      const inner = editor.variants[tag] ?? {};
      const others = withValue(expected, [editor.tag], undefined);
      return built(withValue(data, path, starterOf(editor, tag, languages)), inner, path, others);
    }
    case "elements":
      return (expected as unknown[]).reduce<unknown>(
        (made, element, index) => {
          const added = withValue(made, path, [...listAt(made, path), starter(editor.of, languages)]);
          return built(added, editor.of, [...path, index], element);
        },
        withValue(data, path, []),
      );
    case "languages":
      return Object.entries(expected as Data).reduce((made, [language, value]) => built(made, editor.of, [...path, language], value), data);
    case "constant":
      expect(expected).toBe(schema.const);
      return data;
    case "flag":
      expect(typeof expected).toBe("boolean");
      return withValue(data, path, expected);
    case "number":
      expect(typeof expected).toBe("number");
      return withValue(data, path, expected);
    case "choice":
      expect(editor.options).toContain(expected);
      return withValue(data, path, expected);
    case "text":
      expect(typeof expected).toBe("string");
      return withValue(data, path, expected);
    case "translated":
      return Object.entries(expected as Data).reduce((made, [language, text]) => withValue(made, [...path, language], text), data);
    case "words":
    case "lists":
      expect(Array.isArray(expected)).toBe(true);
      return withValue(data, path, expected);
    default:
      throw new Error(`no editor can set ${path.join(".")}`);
  }
}

const PROGRAM = `
import json, sys, tomllib
from experiments.load import locate, parse_experiment
from experiments.schema.canonical import definition_sha256
from server.studies.toml_edit import with_data
made = json.load(sys.stdin)
if made is None:
    print(json.dumps({n: tomllib.loads(locate(n).read_text("utf-8")) for n in ("exp1", "exp2", "exp3")}))
else:
    hashes = lambda text: definition_sha256(parse_experiment(text))
    print(json.dumps({n: [hashes(with_data("", d)), hashes(locate(n).read_text("utf-8"))] for n, d in made.items()}))
`;

function asked(input: unknown): Record<string, unknown> {
  const printed = execFileSync(python ?? "python3", ["-c", PROGRAM], { cwd: repository, input: JSON.stringify(input) });
  return JSON.parse(printed.toString()) as Record<string, unknown>;
}

describe("the three experiments", () => {
  it("are built by the forms alone, equal to the shipped TOML by their hash", () => {
    const shipped = asked(null);
    expect(Object.keys(shipped)).toEqual(["exp1", "exp2", "exp3"]);
    const made = Object.fromEntries(Object.entries(shipped).map(([name, data]) => [name, built({}, EXPERIMENT, [], data)]));
    for (const [mine, theirs] of Object.values(asked(made)) as [string, string][]) expect(mine).toBe(theirs);
  }, 60_000);
});

describe("data under edit", () => {
  it("change without changing what was there before", () => {
    const before = { a: [{ b: 1 }, { b: 2 }] };
    expect(withValue(before, ["a", 1, "b"], 3)).toEqual({ a: [{ b: 1 }, { b: 3 }] });
    expect(withValue(before, ["a", 0], undefined)).toEqual({ a: [{ b: 2 }] });
    expect(withValue(before, ["c", "d"], 1)).toEqual({ ...before, c: { d: 1 } });
    expect(before).toEqual({ a: [{ b: 1 }, { b: 2 }] });
    expect(withMoved([1, 2, 3], 0, 2)).toEqual([2, 3, 1]);
  });

  it("are undone and done again; a word is one step", () => {
    let history = begun({ title: "a" }, "title = 'a'");
    for (const [index, text] of ["ab", "abc"].entries()) history = edited(history, ["title"], text, 1_000 + index);
    history = edited(history, ["name"], "x", 9_000);
    history = undone(history);
    expect(history.now.data).toEqual({ title: "abc" });
    history = undone(history);
    expect(history.now).toMatchObject({ data: { title: "a" }, toml: "title = 'a'" });
    expect(redone(redone(history)).now.data).toEqual({ title: "abc", name: "x" });
    expect(undone(undone(history))).toBe(undone(history));
  });

  it("are written into the newest text that is known", () => {
    const history = edited(begun({ a: 1 }, "a = 1"), ["a"], 2, 0);
    expect(latestToml(history)).toBe("a = 1");
    expect(latestToml(written(history, history.now.data, "a = 2"))).toBe("a = 2");
    expect(written(history, { a: 2 }, "a = 2").now.toml).toBeNull();
  });
});

describe("names that follow from what participants read", () => {
  const option = (value: string, label: string) => ({ value, label: { en: label } });
  const question = (name: string, label: string, ...options: unknown[]) => ({ name, label: { en: label }, options });
  const form = (...fields: unknown[]) => ({ forms: [{ name: "form", title: { en: "" }, fields }] });
  const options = ["forms", 0, "fields", 0, "options"] as const;

  it("are short, and have letters of every keyboard", () => {
    expect(storedName("I would rather not say")).toBe("i_would_rather_not_say");
    expect(storedName("  Größe, geschätzt ")).toBe("grosse_geschatzt");
    expect(storedName("日本語")).toBe("");
  });

  it("are given to new questions, answers and questionnaires", () => {
    const data = form(question("question", "", option("option", "")));
    const asked = withDerivedName(data, null, ["forms", 0, "fields", 0, "label", "en"], "Your age");
    expect(valueAt(asked, ["forms", 0, "fields", 0, "name"])).toBe("your_age");
    const answered = withDerivedName(asked, null, [...options, 0, "label", "en"], "Yes");
    expect(valueAt(answered, [...options, 0])).toEqual(option("yes", "Yes"));
    const typed = withDerivedName(answered, null, [...options, 0, "label", "en"], "Yes, often");
    expect(valueAt(typed, [...options, 0, "value"])).toBe("yes_often");
    expect(valueAt(withDerivedName(typed, null, ["forms", 0, "title", "en"], "About you"), ["forms", 0, "name"])).toBe("about_you");
  });

  it("stay where answers are stored by them, where somebody chose them, and are never taken twice", () => {
    const data = form(question("age", "Age", option("yes", "Yes"), option("2", "No"), option("option", "")));
    const change = (saved: unknown, index: number, label: string) =>
      valueAt(withDerivedName(data, saved, [...options, index, "label", "en"], label), [...options, index, "value"]);
    expect(change(data, 0, "Yes, often")).toBe("yes");
    expect(change(null, 0, "Yes, often")).toBe("yes_often");
    expect(change(null, 1, "Never")).toBe("2");
    expect(change(null, 2, "Yes")).toBe("yes_2");
    expect(withDerivedName({ title: "a" }, null, ["title"], "b")).toEqual({ title: "b" });
  });
});

describe("keys that every study decides", () => {
  it("are shown, others are under “More” until they are set; stored names always are", () => {
    expect(isBasic("blocks.repeats", false)).toBe(true);
    expect(isBasic("trial.scale.maximum", false)).toBe(true);
    expect(isBasic("render.squint_mm", false)).toBe(false);
    expect(isBasic("analysis.kind", true)).toBe(true);
    expect(isBasic("forms.fields.name", true)).toBe(false);
  });

  it("are keys of the declaration", () => {
    const known = (path: string) =>
      path.split(".").reduce<Schema | undefined>((schema, key) => {
        const inner = schema === undefined ? undefined : withoutNull(resolved(schema));
        const of = inner?.items === undefined ? inner : resolved(inner.items);
        const members = Object.values(of?.discriminator?.mapping ?? {}).map(($ref) => resolved({ $ref }));
        return [of, ...members].map((one) => one?.properties?.[key]).find((one) => one !== undefined);
      }, EXPERIMENT);
    expect([...BASIC, ...TUCKED].filter((path) => known(path) === undefined)).toEqual([]);
  });
});

describe("what differs between two versions", () => {
  const piece = (kind: "same" | "gone" | "new", text: string) => ({ kind, text });

  it("reads as a sentence", () => {
    const path = "forms.about.fields.age.minimum";
    expect(sentenceOf({ path, pieces: [piece("gone", "18"), piece("new", "16")] })).toBe(
      "Changed “Minimum” of the question age of the questionnaire about from 18 to 16.",
    );
    expect(sentenceOf({ path: "forms.demographics", pieces: [piece("new", "{...}")] })).toBe("Added the questionnaire demographics.");
    expect(sentenceOf({ path: "exclusions.1", pieces: [piece("gone", "x")] })).toBe("Removed the exclusion rule 1.");
    const long = [piece("same", "a ".repeat(40)), piece("new", "b")];
    expect(sentenceOf({ path: "texts.en.block_break", pieces: long })).toBe("Changed the text “Block break” in English (en).");
    expect(sentenceOf({ path: "trial.scale.maximum", pieces: [piece("gone", "7"), piece("new", "5")] })).toBe(
      "Changed “Maximum” of “Scale” of “Trial” from 7 to 5.",
    );
  });
});

describe("edits of two people that meet", () => {
  const question = (name: string, minimum: number) => ({ name, minimum, label: { en: name } });
  const base: Data = {
    title: "a",
    forms: [{ name: "about", fields: [question("age", 18), question("height", 1)] }],
    texts: { en: { consent: "c" } },
  };
  const changed = (path: Path, value: unknown, of: unknown = base) => withValue(of, path, value) as Data;

  it("are changes of keys and of elements by their names", () => {
    const fields = [question("weight", 1), question("age", 16), question("height", 1)];
    const changes = changesBetween(base, changed(["forms", 0, "fields"], fields));
    expect(changes.map(({ at }) => placeName(at))).toEqual(["forms.about.fields.age.minimum", "forms.about.fields.weight"]);
    const turned = changesBetween(base, changed(["forms", 0, "fields"], [question("height", 1), question("age", 18)]));
    expect(turned.map(({ at }) => placeName(at))).toEqual(["forms.about.fields"]);
  });

  it("are both kept where they are of different fields", () => {
    const mine = changed(["forms", 0, "fields", 0, "minimum"], 16);
    const theirs = changed(
      ["texts", "en", "consent"],
      "other",
      changed(["forms", 0, "fields"], [question("height", 1), question("age", 18)]),
    );
    const removed = changed(["forms", 0, "fields"], [question("height", 1)]);
    const meeting = meetingOf(base, mine, changed(["texts", "en", "consent"], "other"));
    expect(meeting.both).toEqual([]);
    expect(meeting.merged).toEqual(changed(["texts", "en", "consent"], "other", mine));
    expect(meeting.theirs.map(({ at }) => placeName(at))).toEqual(["texts.en.consent"]);
    expect(meeting.mine.map(({ at }) => placeName(at))).toEqual(["forms.about.fields.age.minimum"]);
    // Their order stays, and my change is in the question that has its name.
    expect(valueAt(meetingOf(base, mine, theirs).merged, ["forms", 0, "fields", 1])).toEqual(question("age", 16));
    // A question that they removed, and I edited: mine for now, with all that it had.
    const back = meetingOf(base, mine, removed);
    expect(back.both.map(({ path }) => path)).toEqual(["forms.about.fields.age"]);
    expect(valueAt(back.merged, ["forms", 0, "fields", 1])).toEqual(question("age", 16));
  });

  it("are shown field by field where both changed the same, and can be taken from either", () => {
    const meeting = meetingOf(base, changed(["title"], "mine"), changed(["title"], "theirs"));
    const [edit] = meeting.both;
    expect(edit?.path).toBe("title");
    expect(meeting.merged["title"]).toBe("mine");
    if (edit !== undefined) expect(withChange(meeting.merged, edit.theirs.at, edit.theirs.after)["title"]).toBe("theirs");
    expect(meetingOf(base, changed(["title"], "same"), changed(["title"], "same")).both).toEqual([]);
  });

  it("are one choice where one removed what the other changed in several fields", () => {
    const without = changed(["forms", 0, "fields", 0], undefined);
    const other = changed(["forms", 0, "fields", 0], { ...question("age", 21), label: { en: "Age" } });
    const { both, theirs, merged } = meetingOf(base, without, other);
    expect(both.map(({ path }) => path)).toEqual(["forms.about.fields.age"]);
    expect(theirs).toEqual([]);
    expect(merged).toEqual(without);
    const [edit] = both;
    if (edit === undefined) throw new Error("expected an edit");
    const taken = withChange(merged, edit.theirs.at, edit.theirs.after);
    expect(valueAt(taken, ["forms", 0, "fields", 1])).toEqual(valueAt(other, ["forms", 0, "fields", 0]));
  });

  it("bring back what one removed, and remove what one took out", () => {
    const without = changed(["forms", 0, "fields", 1], undefined);
    const [change] = changesBetween(base, without);
    if (change === undefined) throw new Error("expected a change");
    expect(withChange(base, change.at, change.after)).toEqual(without);
    expect(withChange(without, change.at, change.before)).toEqual(base);
    expect(withChange(without, change.at, undefined)).toEqual(without);
  });
});

describe("words of the builder", () => {
  it("reads keys as words with their units", () => {
    expect(labelOf("failed_longest_gap_ms")).toBe("Failed longest gap (ms)");
    expect(labelOf("name")).toBe("Name");
    expect(labelOf("break_seconds_min")).toBe("Shortest break (seconds)");
    expect(freeName("form", ["form", "form_2"])).toBe("form_3");
  });

  it("offers what is declared elsewhere", () => {
    const data = {
      factors: [{ name: "speed", levels: [{ name: "slow" }, { name: "fast" }] }],
      forms: [{ name: "about", fields: [{ name: "vision", options: [{ value: "normal" }] }] }],
      screening: [{ rule: "form_answer", form: "about", field: "vision" }],
    };
    expect(suggestionsFor(data, ["blocks", "split_by"])).toEqual(["speed"]);
    expect(suggestionsFor(data, ["trial", "reference", "cell"])).toEqual(["slow", "fast"]);
    expect(suggestionsFor(data, ["screening", 0, "field"])).toEqual(["vision"]);
    expect(suggestionsFor(data, ["screening", 0, "refused"])).toEqual(["normal"]);
  });

  it("puts forms of the bank into the languages of the study", () => {
    const [first] = FORMS;
    expect(inLanguages(first?.form["title"], ["de", "fr"])).toEqual({ de: "Über Sie", fr: "About you" });
  });
});

describe("help", () => {
  const texts = [EXPERIMENT, ...Object.values(EXPERIMENT.$defs ?? {})].flatMap((table) => [
    table,
    ...Object.values(table.properties ?? {}),
  ]);

  it("names the labels of the page, never a key of the TOML", () => {
    expect(helpOf({ description: "Nothing until `pointer_delay_ms` have passed." })).toBe(
      "Nothing until “Pointer delay (ms)” have passed.",
    );
    expect(helpOf({ description: "Instead of the one: [[trial.scales]]." })).toBe("Instead of the one: “Scales”.");
    expect(helpOf({ description: 'In ms; with `start = "fixation"`.' })).toBe("In ms; with “Start” is “fixation”.");
    const named = texts.map(helpOf).filter((help) => /\[\[|`|\b[a-z]+_(ms|per|person|narrow|title|frames|mm|on_focus_lost)\b/.test(help));
    // Columns of the exported data are called so there, too.
    expect(named.filter((help) => !/px_per_mm|viewing_distance_mm/.test(help))).toEqual([]);
  });
});

describe("the preview of a trial", () => {
  it.each<[string, object, string[], boolean]>([
    ["a rating", { kind: "clip_rating" }, ["clip"], false],
    ["a rating after its reference", { kind: "clip_rating", reference: { level: "a" } }, ["reference", "clip"], false],
    ["a pair", { kind: "paired_comparison" }, ["left clip", "right clip"], false],
    ["a stacked pair", { kind: "paired_comparison", presentation: { arrangement: "stacked" } }, ["upper clip", "lower clip"], true],
    [
      "a pair in turn",
      { kind: "paired_comparison", presentation: { arrangement: "one_after_the_other" } },
      ["1st clip", "2nd clip"],
      false,
    ],
    ["two intervals", { kind: "threshold", task: { asks: "two_interval" } }, ["1st clip", "2nd clip"], false],
    ["yes or no", { kind: "threshold", task: { asks: "yes_no" } }, ["clip"], false],
  ])("has the clips of %s", (_, trial, words, stacked) => {
    expect(shownClips(trial)).toEqual({ words, stacked });
  });
});

describe("buttons that add to a list", () => {
  it("name one of it, for every list of a declaration", () => {
    const one = ["languages", "factors", "series", "categories", "own per", "exclusions", "choices", "verdicts"].map(singularOf);
    expect(one).toEqual(["language", "factor", "series", "category", "own per", "exclusion", "choice", "verdict"]);
  });
});

describe("what a form begins with", () => {
  const levels = (...names: string[]) => names.map((name) => ({ name }));
  const data: Data = {
    factors: [
      { name: "face", levels: levels("ada") },
      { name: "speed", levels: levels("50", "75") },
    ],
    trial: { stimulus: { factor: "speed" } },
  };

  it("names the first factor where one is required, and offers the levels of the chosen one", () => {
    expect(withFirstFactor(data, ["trial", "pairs"], { among: "within", factor: "" })).toEqual({ among: "within", factor: "face" });
    expect(withFirstFactor(data, ["trial", "pairs"], { among: "all" })).toEqual({ among: "all" });
    expect(suggestionsFor(data, ["trial", "task", "standard"])).toEqual(["50", "75"]);
  });

  it("fills a consent template with what the study says, and lists what is left", () => {
    const [online = ""] = Object.values(CONSENTS["en"] ?? {});
    const text = withKnown(online, { title: "Smiles & $1", minutes: "7" });
    expect(text).toContain("# Smiles & $1");
    expect(text).toContain("about 7 minutes");
    for (const template of Object.values(CONSENTS["en"] ?? {}))
      expect(withKnown(template, { title: "", minutes: "1" })).toContain("It takes about 1 minute.");
    for (const template of Object.values(CONSENTS["de"] ?? {}))
      expect(withKnown(template, { title: "", minutes: "1" })).toContain("etwa 1 Minute.");
    expect(unfilledMarks(text)).toEqual(["[topic]", "[name, institution, e-mail]", "[number]"]);
    expect(withKnown("# [Titel], [Minuten]", { title: "", minutes: "" })).toBe("# [Titel], [Minuten]");
    expect(unfilledMarks("See [our page](https://example.org).")).toEqual([]);
  });
});
