/** A run that is over: withdrawn, screened out or complete, with its code as often as it is asked for. */
import type { RunStarted, RunState } from "../../api/schema";
import type { Translate } from "../../i18n";
import { button } from "../../ui/page";
import { showCompletion } from "../screens/completion";
import { completed } from "../screens/finish";
import { emptied, type Back, showNotice } from "../screens/notice";
import type { Identity } from "./identity";
import { persistently } from "./link";

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
  // On a laboratory's computer the next person comes by the same link.
  const anew = (): void => {
    identity.forget();
    location.reload();
  };
  if (run.status === "withdrawn") {
    const actions = identity.isNamed ? [] : [{ label: t("new_visit"), press: anew }];
    return void showNotice(root, { title: t("withdrawn_title"), text: t("withdrawn"), actions, back });
  }
  const done = await persistently(root, t, () => completed(started.run_token));
  const next = identity.isNamed ? [] : [button(t("new_visit"), anew, "plain")];
  showCompletion({ t, run }, emptied(root), done, next, why);
}
