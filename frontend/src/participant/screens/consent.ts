/** Consent: must be given by a tick; the server stores when. */
import { h, uniqueId } from "../../ui/element";
import { markdown } from "../../ui/markdown";
import { alertLine, button, showPage, statusLine } from "../../ui/page";
import { plugin, BOOL, STRING, type PluginClass } from "../jspsych";
import { wayBack } from "../flow/link";
import { showNotice } from "./notice";
import type { Session } from "../session";
import { isSaving, saveShown, setSaving } from "./support";

interface Parameters {
  eyebrow: string;
}
interface Data {
  agreed: boolean;
}

export function consent(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "consent",
    parameters: { eyebrow: STRING }, // small line above the title
    data: { agreed: BOOL }, // always true: without consent there is no data
    show: (display, { eyebrow }) => new Promise((resolve) => showConsent(session, display, eyebrow, () => resolve({ agreed: true }))),
    simulate: async () => {
      await session.api.consent();
      return { agreed: true };
    },
    act(display) {
      display.querySelector<HTMLInputElement>("input")?.click();
      display.querySelector<HTMLButtonElement>(".primary")?.click();
    },
  });
}

function showConsent(session: Session, display: HTMLElement, eyebrow: string, done: () => void): void {
  const { t } = session;
  const alert = alertLine();
  alert.id = uniqueId("alert");
  const status = statusLine();
  const box = h("input", { type: "checkbox", id: uniqueId("agree"), "aria-describedby": alert.id });
  const go = button(t("continue"), () => {
    if (isSaving(go)) return;
    alert.textContent = box.checked ? "" : t("consent_needed");
    if (!box.checked) return box.focus();
    setSaving(go, true);
    void saveShown(session, status, session.api.consent()).then((outcome) => (outcome.accepted ? done() : setSaving(go, false)));
  });
  const agree = h("label", { class: "tick", for: box.id }, box, h("span", {}, t("consent_agree")));
  showPage(display, {
    eyebrow,
    body: [h("div", { class: "prose" }, ...markdown(session.run.texts.consent)), agree, alert, status],
    actions: [go, button(t("consent_decline"), () => void decline(session, status), "plain")],
  });
}

/** The run ends with nothing but the refusal stored; without a connection the outbox keeps that. */
async function decline(session: Session, status: HTMLElement): Promise<void> {
  const { t, root, over } = session;
  const outcome = await saveShown(session, status, session.api.decline());
  if (!outcome.accepted) return;
  over.abort();
  showNotice(root, { title: t("declined_title"), text: t("declined"), back: wayBack(t, session.link) });
}
