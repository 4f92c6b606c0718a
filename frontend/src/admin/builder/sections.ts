/** The pages of the builder, and the keys of the declaration on each. */

import { EXPERIMENT } from "./schema";

export interface Section {
  id: string;
  label: string;
  about: string;
  keys: readonly string[];
}

const NAMED: readonly Section[] = [
  {
    id: "study",
    label: "Study",
    about: "What the study is called, where it comes from, and in which languages people may take part.",
    keys: ["name", "title", "participant_title", "source", "version", "participants", "languages"],
  },
  {
    id: "factors",
    label: "Factors and clips",
    about: "The factors and their levels make the cells; each cell has as many clips as exemplars. Order is that of tables and figures.",
    keys: ["factors", "exemplars", "render"],
  },
  { id: "trial", label: "Trial", about: "What one trial shows and asks.", keys: ["trial"] },
  {
    id: "order",
    label: "Practice and order",
    about: "Practice, blocks, counterbalancing, and who sees which clips.",
    keys: ["practice", "blocks", "assignment", "groups"],
  },
  {
    id: "forms",
    label: "Questionnaires",
    about: "Pages of questions before and after the trials. Answers become columns of the runs.",
    keys: ["forms"],
  },
  { id: "texts", label: "Texts", about: "The pages that participants read, in Markdown, in each language.", keys: ["texts"] },
  {
    id: "screen",
    label: "Screen and playback",
    about: "Size and surround of the clips, what the device must offer, and when a play counts.",
    keys: ["display", "playback", "session"],
  },
  {
    id: "rules",
    label: "Checks and exclusions",
    about: "Attention and motion checks, who is screened out or warned while taking part, and whose data the analysis leaves out.",
    keys: ["attention", "evidence", "screening", "warnings", "exclusions"],
  },
  { id: "analysis", label: "Analysis", about: "The analysis, fixed before the data.", keys: ["analysis"] },
  {
    id: "dataset",
    label: "Keeping and handing on",
    about: "How long data of persons are kept, and who may use the data under which licence.",
    keys: ["retention", "dataset"],
  },
];

const placed = new Set(NAMED.flatMap((section) => section.keys));
const further = Object.keys(EXPERIMENT.properties ?? {}).filter((key) => !placed.has(key));

/** Every key of the declaration stands on one of these pages; a key that none names is on the last. */
export const SECTIONS: readonly Section[] = [
  ...NAMED,
  ...(further.length > 0 ? [{ id: "further", label: "Further", about: "Further keys of the declaration.", keys: further }] : []),
];

/** The page on which the key at the beginning of a path is edited. */
export function sectionOf(path: string): Section | undefined {
  const [key = ""] = path.split(".");
  return SECTIONS.find((section) => section.keys.includes(key));
}
