/** Waits until the server has chosen a trial's stimulus; without connection a few trials go on with what is known. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { showPage } from "../../../ui/page";
import type { Session } from "../../session";
import { declaredThreshold } from "./declared";

/** The answer before is usually acknowledged by now; a slow connection holds nobody up for longer. */
const CHOICE_WITHIN_MS = 1_500;

/** Earlier trials of the series that the choice of this one did not know. */
export function behind({ series }: TrialInfo): number {
  return series ? series.position - 1 - series.known : 0;
}

export async function awaitChoice(session: Session, display: HTMLElement, trial: TrialInfo): Promise<void> {
  const { outbox, t } = session;
  if (behind(trial) > 0 && outbox.state.failures === 0) await outbox.drained(CHOICE_WITHIN_MS);
  if (behind(trial) <= declaredThreshold(session).ahead) return;
  const remark = h("p", { role: "status" }, t("saving_offline"));
  showPage(display, { title: t("saving"), body: [remark] });
  // With every answer sent there is nothing more to know: failed clips never count before they are repeated.
  await outbox.drained();
}
