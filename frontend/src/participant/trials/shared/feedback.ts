/** After a practice trial: a word about the procedure, never about the answer. */
import type { MessageKey } from "../../../i18n";
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { choose } from "../../screens/support";
import type { Session } from "../../session";
import type { Shown } from "./showing";
import type { Stage } from "./stage";

const SLOW_MS = 8_000;

function procedureRemark(showings: Shown[], rt_ms: number): MessageKey {
  if (showings.some((shown) => shown.focus_lost > 0)) return "feedback_focus";
  if (showings.some((shown) => shown.early_keys > 0)) return "feedback_key";
  return rt_ms > SLOW_MS ? "feedback_slow" : "feedback_good";
}

/** The procedure of these showings is to be tried once more, as long as the trial may be shown again. */
const AGAIN: MessageKey[] = ["feedback_focus", "feedback_key"];

export interface Practised {
  trial: TrialInfo;
  play: number;
  showings: Shown[];
  rt_ms: number;
}

/** Say how the procedure went; where it went wrong the same trial comes once more. */
export async function procedureFeedback(session: Session, stage: Stage, { trial, play, showings, rt_ms }: Practised): Promise<void> {
  const { t, run, replays } = session;
  const footer = h("div", { class: "actions" });
  const key = procedureRemark(showings, rt_ms);
  const again = AGAIN.includes(key) && play <= run.playback.max_repeats;
  const text = t(key, { seconds: Math.round(rt_ms / 1000) }) + (again ? ` ${t("feedback_again")}` : "");
  stage.below.replaceChildren(h("h1", { class: "feedback" }, h("span", { role: "status" }, text)), footer);
  await choose(session, footer, [{ label: t(again ? "try_again" : "continue"), value: true }], "always");
  if (again) replays.add(trial, play + 1);
}
