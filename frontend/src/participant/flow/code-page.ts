/** The page that asks for a resume code; loaded where one is needed. */
import type { RunStarted } from "../../api/schema";
import type { MessageKey, Translate } from "../../i18n";
import { h, uniqueId, alertLine, button, showPage } from "../../ui/element";
import { Refused } from "../request";
import { emptied } from "../screens/support";
import type { Identity } from "./identity";
import { isNoAnswer, type Claim, type Start } from "./link";

const WRONG: Record<string, MessageKey> = { resume_code_wrong: "code_wrong", too_many_requests: "code_wait" };

/** Ask for the code until one fits, or the rater starts over; other refusals are thrown. */
export function codePage(root: HTMLElement, t: Translate, why: MessageKey, identity: Identity, start: Start): Promise<RunStarted> {
  const alert = alertLine();
  alert.id = uniqueId("alert");
  const input = h("input", {
    id: uniqueId("code"),
    type: "text",
    autocomplete: "off",
    autocapitalize: "characters",
    spellcheck: false,
    maxlength: 20,
    "aria-describedby": alert.id,
  });
  return new Promise((resolve, reject) => {
    const claim = (what: Claim): void => {
      alert.textContent = "";
      start(what).then(
        (started) => {
          if ("resume_code" in what) identity.keepCode(what.resume_code);
          resolve(started);
        },
        (error: unknown) => {
          // Nothing has begun here: who loads the page again comes to the first page.
          if (why === "code_enter") identity.forget();
          const key = error instanceof Refused ? WRONG[error.code] : isNoAnswer(error) ? "no_answer" : undefined;
          if (!key) return reject(error instanceof Error ? error : new Error(String(error)));
          alert.textContent = t(key);
          input.focus();
        },
      );
    };
    const enter = (event: Event): void => {
      event.preventDefault();
      claim({ resume_code: input.value });
    };
    const go = h("button", { type: "submit", class: "button primary" }, t("continue"));
    // Somebody who entered a code has begun nothing under a recruiter's ID.
    const startOver = why === "code_needed" ? button(t("code_anew"), () => claim({ anew: true }), "quiet") : null;
    const back = why === "code_enter" ? button(t("code_back"), () => location.reload(), "quiet") : null;
    const form = h(
      "form",
      { onsubmit: enter },
      h("p", { class: "field" }, h("label", { for: input.id }, t("code_label")), input),
      alert,
      h("footer", { class: "actions" }, go, startOver, back),
    );
    showPage(emptied(root), { title: t("code_title"), body: [h("p", {}, t(why)), form] });
    input.focus();
  });
}
