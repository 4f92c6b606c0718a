/** Says that a clip cannot be shown, and goes on. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { showPage } from "../../../ui/page";
import { ClipBroken } from "../../playback/player";
import { choose } from "../../screens/support";
import type { Session } from "../../session";
import type { RatingBody } from "../rating";
import { hashesOf } from "./prepare";

const READ_MS = 1_000;

/** For `catch` of a trial: where its clip could not be shown the participant is told, and the play has no answer. */
export function unlessBroken(session: Session, display: HTMLElement, trial: TrialInfo, unrated: () => RatingBody) {
  return async (error: unknown): Promise<RatingBody> => {
    if (!(error instanceof ClipBroken)) throw error;
    session.events.add("clip_unavailable", { clip_sha256: trial.clip_sha256, clips: hashesOf(trial), reason: error.message });
    const footer = h("footer", { class: "actions" });
    const text = h("p", { role: "alert" }, session.t("clip_broken"));
    showPage(display, { title: session.t("clip_broken_title"), body: [text, footer] });
    // As long as the server expects a play to take for which nothing was rated (TRIED_MS): time to read it.
    await new Promise((resolve) => setTimeout(resolve, READ_MS));
    await choose(session, footer, [{ label: session.t("continue"), value: true }], "never");
    return unrated();
  };
}
