/** Pages of text: the declared ones, consent, and the rest between blocks. */
import { h, showPage, uniqueId, alertLine, button, statusLine } from "../../ui/element";
import { markdown } from "../../ui/markdown";
import { plugin, STRING, type PluginClass, BOOL, INT, pressWhile } from "../jspsych";
import type { Session } from "../session";
import { choose, stopButton, showNotice, isSaving, saveShown, setSaving } from "./support";
import { wayBack } from "../flow/link";
import { loadModule } from "../../ui/load-module";
import type { RestData, RestParameters } from "./rest";

// A page of the declared text: instructions, practice, breaks without a pause.

export interface TextPageParameters {
  eyebrow: string;
  text: string;
  action: string;
  remarks: string;
}
interface TextPageData {
  read_ms: number;
}

export function textPage(session: Session): PluginClass<TextPageParameters> {
  return plugin<TextPageParameters, TextPageData>({
    name: "text-page",
    parameters: {
      eyebrow: STRING, // small line above the title
      text: STRING, // the text in Markdown
      action: STRING, // label of the button that goes on
      remarks: STRING, // a plain paragraph after the text, or empty
    },
    data: { read_ms: STRING }, // time on the page in ms
    async show(display, { eyebrow, text, action, remarks }) {
      const started = performance.now();
      const footer = h("footer", { class: "actions" });
      const note = remarks ? h("p", {}, remarks) : null;
      const section = showPage(display, { eyebrow, body: [h("div", { class: "prose" }, ...markdown(text), note), footer] });
      section.append(stopButton(session));
      await choose(session, footer, [{ label: action, value: true }]);
      return { read_ms: Math.round(performance.now() - started) };
    },
    simulate: () => ({ read_ms: 0 }),
    act: (display) => display.querySelector<HTMLButtonElement>(".actions .primary")?.click(),
  });
}

// Consent: must be given by a tick; the server stores when.

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

// The rest between blocks; its code loads during the first trials.

/** Fetched with the first clips, so that it is here when its turn comes, also without a connection. */
export const loadRest = (): Promise<typeof import("./rest")> => loadModule(() => import("./rest"));

export function blockBreak(session: Session): PluginClass<RestParameters> {
  return plugin<RestParameters, RestData>({
    name: "block-break",
    parameters: {
      block: INT, // the block that comes next
      blocks: INT, // how many blocks there are
      seconds_min: INT, // shortest rest in seconds
    },
    data: { rested_ms: INT }, // length of the rest in ms
    show: async (display, parameters) => (await loadRest()).rest(session, display, parameters),
    simulate: () => ({ rested_ms: 0 }),
    act: (display) => pressWhile(display, ".break", [".primary"]),
  });
}
