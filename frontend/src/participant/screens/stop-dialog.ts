/** Pausing or withdrawing, asked for once more. */
import { h, button } from "../../ui/element";
import { wayBack } from "../flow/link";
import { showNotice, codeNote } from "./support";
import type { Session } from "../session";

export function openStopDialog(session: Session): void {
  const { t } = session;
  const dialog = h("dialog", { class: "dialog", "aria-labelledby": "stop-title" });
  const close = (): void => dialog.remove();
  const pause = (): void => {
    close();
    end(session, "paused");
  };
  const withdraw = (): void => (close(), void withdrawn(session));
  dialog.append(
    h("h2", { id: "stop-title" }, t("stop_title")),
    h(
      "div",
      { class: "stack" },
      button(t("stop_continue"), close),
      button(t("stop_later"), pause, "quiet"),
      button(t("stop_withdraw"), withdraw, "quiet"),
    ),
  );
  dialog.addEventListener("close", close);
  session.root.append(dialog);
  dialog.showModal();
}

async function withdrawn(session: Session): Promise<void> {
  await session.outbox.put("POST", "/api/run/withdraw", {});
  await session.outbox.drained(5_000);
  // Without a connection the wish stays in the outbox, and the next visit sends it.
  end(session, "withdrawn");
}

function end(session: Session, what: "paused" | "withdrawn"): void {
  const { t } = session;
  session.over.abort();
  const more = what === "paused" ? [h("p", {}, codeNote(session))] : [];
  const back = what === "withdrawn" ? wayBack(t, session.link) : null;
  showNotice(session.root, { title: t(`${what}_title`), text: t(what), more, back });
}
