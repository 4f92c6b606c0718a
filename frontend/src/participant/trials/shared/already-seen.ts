/** Above a scale that a reload has brought back: the clip is not shown a second time. */
import { h } from "../../../ui/element";
import type { Session } from "../../session";
import type { Stage } from "./stage";

export function sayAlreadySeen(session: Session, stage: Stage): void {
  stage.element.querySelector(".above")?.replaceChildren(h("p", { role: "status" }, session.t("already_seen")));
}
