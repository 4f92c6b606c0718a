/** Taking up a visit by its resume code, where the browser and the link do not say whose it is. */
import type { RunStarted } from "../../api/schema";
import type { MessageKey } from "../../i18n";
import { Refused } from "../request";

/** What a start says beside what every start says. */
export type Claim = { resume_code: string } | { anew: true } | Record<string, never>;
export type Start = (claim: Claim) => Promise<RunStarted>;

const ASKED_FOR: Record<string, MessageKey> = {
  resume_code_needed: "code_needed",
  taken_part_already: "code_over",
  resume_code_wrong: "code_enter",
};
/** Why a code must be entered; null where the refusal is another. */
export function asksForCode(error: unknown): MessageKey | null {
  return error instanceof Refused ? (ASKED_FOR[error.code] ?? null) : null;
}
