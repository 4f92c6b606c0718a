/** Says that a clip cannot be shown, and goes on. */
import { h } from "../../../ui/element";
import { showPage } from "../../../ui/page";
import { choose } from "../../screens/support";
import type { Session } from "../../session";

export async function showBroken(session: Session, display: HTMLElement): Promise<void> {
  const footer = h("footer", { class: "actions" });
  const text = h("p", { role: "alert" }, session.t("clip_broken"));
  showPage(display, { title: session.t("clip_broken_title"), body: [text, footer] });
  await choose(session, footer, [{ label: session.t("continue"), value: true }]);
}
