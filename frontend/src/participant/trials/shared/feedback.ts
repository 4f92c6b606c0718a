/** After a practice trial: a word about the procedure, never about the answer. */
import type { MessageKey } from "../../../i18n";
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

export async function procedureFeedback(session: Session, place: Stage, showings: Shown[], rt_ms: number): Promise<void> {
  const footer = h("div", { class: "actions" });
  const text = session.t(procedureRemark(showings, rt_ms), { seconds: Math.round(rt_ms / 1000) });
  place.below.replaceChildren(h("h1", { class: "feedback" }, h("span", { role: "status" }, text)), footer);
  await choose(session, footer, [{ label: session.t("continue"), value: true }], true);
}
