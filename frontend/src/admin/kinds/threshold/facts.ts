/** What the admin site knows of thresholds. */
import { textAt } from "../../builder/data";
import { type AdminKind, IN_TURN } from "../kind";

export const kind: AdminKind = {
  preview: (trial) => (textAt(trial, ["task", "asks"]) === "two_interval" ? { words: IN_TURN, stacked: false } : null),
};
