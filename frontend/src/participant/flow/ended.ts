/** A run that is over: withdrawn, screened out or complete, with its code as often as it is asked for. */
import type { RunStarted, RunState } from "../../api/schema";
import type { Translate } from "../../i18n";
import { beginAnew, nextPerson, showCompletion } from "../screens/completion";
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
  if (run.status === "withdrawn") {
    const actions = identity.isNamed ? [] : [{ label: t("new_visit"), press: () => beginAnew(identity) }];
    return void showNotice(root, { title: t("withdrawn_title"), text: t("withdrawn"), actions, back });
  }
  const done = await persistently(root, t, () => completed(started.run_token));
  showCompletion({ t, run }, emptied(root), done, nextPerson(t, identity), why);
}
