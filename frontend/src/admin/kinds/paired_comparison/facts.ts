/** What the admin site knows of paired comparisons. */
import { textAt } from "../../builder/data";
import { type AdminKind, IN_TURN } from "../kind";

export const kind: AdminKind = {
  preview(trial) {
    const arrangement = textAt(trial, ["presentation", "arrangement"]);
    if (arrangement === "stacked") return { words: ["upper clip", "lower clip"], stacked: true };
    return { words: arrangement === "one_after_the_other" ? IN_TURN : ["left clip", "right clip"], stacked: false };
  },
  presentation(trial, answered) {
    if (trial.kind !== "paired_comparison") return null;
    const declared = trial.presentation;
    // Where the window was too narrow for the declared arrangement, the answer says that the clips were stacked.
    const isStacked = declared.arrangement === "side_by_side" && answered === "stacked";
    return isStacked ? { arrangement: "stacked", gap_mm: declared.gap_mm } : declared;
  },
};
