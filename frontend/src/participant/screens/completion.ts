/** The last page of a visit, whether it has just ended or was over before. */
import type { Completion, RunStarted, RunState } from "../../api/schema";
import { h, button, showPage } from "../../ui/element";
import { markdown } from "../../ui/markdown";
import type { Translate } from "../../i18n";
import type { Identity } from "../flow/identity";
import type { Session } from "../session";
import { completed } from "./finish";
import { emptied, type Back, showNotice } from "./support";
import { persistently } from "../flow/link";

// The last page: thanks, the code, and the way back.

/** Begin as another person: on a laboratory's computer she comes by the same link. */
export function beginAnew(identity: Identity): void {
  identity.forget();
  location.reload();
}

/** The way on for another person; none where the address names who takes part. */
export function nextPerson(t: Translate, identity: Identity): HTMLElement[] {
  return identity.isNamed ? [] : [button(t("new_visit"), () => beginAnew(identity), "plain")];
}

/** The last page, also for people who are screened out. It lies outside the timeline, which clears what its screens have shown. */
export function showCompletion(
  session: Pick<Session, "t" | "run">,
  display: HTMLElement,
  done: Completion,
  extra: HTMLElement[] = [],
  why = "",
): void {
  const { t, run } = session;
  const out = done.status === "screened_out";
  const code =
    done.completion_code &&
    h(
      "div",
      { class: "code" },
      h("p", { class: "help" }, t(out ? "out_code" : "done_code")),
      codeRow(t("done_copy"), t("done_copied"), done.completion_code),
    );
  const back = done.redirect_url && h("a", { class: "button primary", href: done.redirect_url, rel: "noreferrer" }, t("done_return"));
  const text = out ? run.texts.screened_out || `# ${t("screened_out_title")}\n\n${t("screened_out")}` : run.texts.debrief;
  const prose = h("div", { class: "prose" }, ...markdown(text));
  showPage(display, {
    body: [
      (done.reason || why) && h("p", { role: "alert" }, done.reason || why),
      prose,
      code,
      h("p", { class: "status", role: "status" }, t(out ? "close" : "done_close")),
    ],
    actions: [back, ...extra],
  });
}

function codeRow(copy: string, copied: string, code: string): HTMLElement {
  const row = h("p", { class: "row" }, h("output", {}, code));
  // Pages without a secure connection have no clipboard.
  if (!("clipboard" in navigator)) return row;
  const write = async (): Promise<void> => {
    await navigator.clipboard.writeText(code);
    press.textContent = copied;
  };
  const press = button(copy, () => void write().catch(() => {}), "quiet");
  row.append(press);
  return row;
}

// A run that is over: withdrawn, screened out or complete, with its code as often as it is asked for.

/** `why` is said first where the participant does not know yet what ended the run. */
export async function ended(
  root: HTMLElement,
  t: Translate,
  run: RunState,
  started: RunStarted,
  identity: Identity,
  back: Back,
  why = "",
): Promise<void> {
  if (run.status === "withdrawn") {
    const actions = identity.isNamed ? [] : [{ label: t("new_visit"), press: () => beginAnew(identity) }];
    return void showNotice(root, { title: t("withdrawn_title"), text: t("withdrawn"), actions, back });
  }
  const done = await persistently(root, t, () => completed(started.run_token));
  showCompletion({ t, run }, emptied(root), done, nextPerson(t, identity), why);
}
