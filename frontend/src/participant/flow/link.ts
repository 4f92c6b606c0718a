/** From the link to a run: is it open, can this browser show it, and which visit is it? */
import type { LinkDocument, RunDocument, StartedRun } from "../../api/participant";
import { call, NetworkError, Refused, isTemporary, request } from "../../api/request";
import type { MessageKey, Translate } from "../../i18n";
import { backoff } from "../outbox/backoff";
import { showNotice } from "../screens/notice";
import { abilities, type GateFinding, findings } from "./gates";

/** Ask until the server answers, telling the participant meanwhile. Refusals are thrown. */
export async function persistently<Body>(root: HTMLElement, t: Translate, ask: () => Promise<Body>): Promise<Body> {
  for (let failures = 1; ; failures += 1) {
    try {
      return await ask();
    } catch (error) {
      const again = error instanceof NetworkError || (error instanceof Refused && isTemporary(error.status));
      if (!again) throw error;
      if (failures > 1) showNotice(root, { title: t("no_answer_title"), text: t("no_answer") });
      await new Promise((resolve) => setTimeout(resolve, backoff(failures)));
    }
  }
}

export const fetchLink = (token: string): Promise<LinkDocument> => call("GET", `/api/links/${encodeURIComponent(token)}`);

/** The run as the page sees it: practice is no block. */
export async function fetchRun(token: string): Promise<RunDocument> {
  const run = await call<RunDocument>("GET", "/api/run", { token, timeout_ms: 30_000 });
  return { ...run, blocks: run.blocks.filter(({ block }) => block > 0) };
}

export const startRun = (link_token: string, body: object): Promise<StartedRun> =>
  call("POST", `/api/links/${encodeURIComponent(link_token)}/runs`, { body });

const REFUSALS: Record<string, MessageKey> = {
  link_unknown: "link_unknown", study_closed: "link_closed", link_used: "link_used", run_too_old: "run_too_old",
  study_full: "link_full", link_expired: "link_expired", study_paused: "link_paused", closed: "link_closed",
  expired: "link_expired", full: "link_full", paused: "link_paused", used: "link_used",
};

/** Tell why this link leads nowhere: by the link's status or the server's refusal. */
export function showRefusal(root: HTMLElement, t: Translate, code: string, message = ""): void {
  const key = REFUSALS[code];
  const title = t(code === "link_unknown" ? "link_unknown_title" : "link_title");
  showNotice(root, { title, text: key ? t(key) : message || t("link_closed") });
}

/** Resolves true where the browser can show the study, after asking where it can only nearly. */
export async function passGates(root: HTMLElement, t: Translate, link_token: string, link: LinkDocument, storage: boolean): Promise<GateFinding[] | null> {
  const found = abilities(storage);
  const list = findings(found, link.gates);
  const first = list[0];
  if (first?.closed) {
    showNotice(root, { title: t("gate_title"), text: t(first.reason, first.values) });
    // Nothing waits for this: the participant reads the page, the experimenter the count.
    void request("POST", "/api/unsupported", { body: { link_token, reason: first.reason, data: found } }).catch(() => {});
    return null;
  }
  for (const { reason, values } of list) {
    await new Promise<void>((resolve) => {
      showNotice(root, { title: t("gate_title"), text: t(reason, values), actions: [{ label: t("gate_continue"), press: resolve }] });
    });
  }
  return list;
}
