/** What stops a visit before it has begun: a link that leads nowhere, a browser that cannot, or can only nearly, show the study. */
import { call, Refused, request } from "../request";
import type { MessageKey, Translate } from "../../i18n";
import { type Back, showNotice } from "../screens/support";
import { loadModule } from "../../ui/load-module";
import type { RunStarted, LinkState } from "../../api/schema";
import { type Abilities, type GateFinding, lackOfRoom, measures } from "./gates";
import type { Identity } from "./identity";
import { fetchRun } from "./enter";
import { type Entry, persistently, wayBack } from "./link";

const REFUSALS: Record<string, MessageKey> = {
  link_unknown: "link_unknown",
  study_closed: "link_closed",
  run_too_old: "run_too_old",
  run_left: "run_left",
  study_full: "link_full",
  link_expired: "link_expired",
  study_paused: "link_paused",
  closed: "link_closed",
  expired: "link_expired",
  full: "link_full",
  paused: "link_paused",
  used: "link_used",
};

/** Explain why this link leads nowhere: by the link's status or the server's refusal. */
export function showRefusal(root: HTMLElement, t: Translate, code: string, message = "", back: Back = null): void {
  const key = REFUSALS[code];
  const title = t(code === "link_unknown" ? "link_unknown_title" : "link_title");
  showNotice(root, { title, text: key ? t(key) : message || t("link_closed"), back });
}

/** Explain why this browser cannot show the study, and report it to the server. */
function showClosedGate(root: HTMLElement, t: Translate, link_token: string, closed: GateFinding, device: Abilities, back: Back): void {
  showNotice(root, { title: t("gate_title"), text: t(closed.reason, closed.values), back });
  // Nothing waits for this: the participant reads the page, the experimenter the count.
  void request("POST", "/api/unsupported", { body: { link_token, reason: closed.reason, data: device } }).catch(() => {});
}

/** End a run because this browser cannot show the study, where the study screens devices. */
async function screenOutDevice(run_token: string, closed: GateFinding, device: Abilities): Promise<void> {
  const body = { reason: closed.reason, data: device };
  // Asked twice, where the first answer was lost, the run is closed already.
  await call("POST", "/api/run/screen-out", { token: run_token, body }).catch((error: unknown) => {
    if (!(error instanceof Refused && error.code === "run_closed")) throw error;
  });
}

/** Where the browser can only nearly show the study, ask whether to go on all the same. */
export async function passGates(root: HTMLElement, t: Translate, list: GateFinding[]): Promise<void> {
  for (const { reason, values } of list) {
    await new Promise<void>((resolve) => {
      showNotice(root, { title: t("gate_open_title"), text: t(reason, values), actions: [{ label: t("gate_continue"), press: resolve }] });
    });
  }
}

/** A closed gate: explained; where the study screens devices, a visit that has not got further ends here with a way back. */
export async function turnedAway(
  { root, t, link_token, link, kept }: Entry,
  identity: Identity,
  returns: boolean,
  closed: GateFinding,
  device: Abilities,
  begun: () => Promise<RunStarted>,
): Promise<void> {
  const explain = (): void => showClosedGate(root, t, link_token, closed, device, wayBack(t, link));
  // A run begun in another browser is left to that one: starting it here would take it over.
  const elsewhere = returns && !identity.isKnown;
  if (!link.screens_devices || kept || elsewhere) {
    explain();
    return;
  }
  const started = await begun();
  const before = await persistently(root, t, () => fetchRun(started.run_token));
  if (before.status === "active" && before.consented_at) {
    explain();
    return;
  }
  if (before.status === "active") await persistently(root, t, () => screenOutDevice(started.run_token, closed, device));
  const run = await persistently(root, t, () => fetchRun(started.run_token));
  const { ended } = await loadModule(() => import("../screens/completion"));
  await ended(root, t, run, started, identity, wayBack(t, link), t(closed.reason, closed.values));
}

// The page that asks for a larger window or a smaller zoom, before anything has begun; loaded where it is needed.

/**
 * Wait until the window has room for the clips, before anything has begun. True as soon as it has; false where the
 * study screens devices and the participant has no other one.
 */
export function waitForRoom(root: HTMLElement, t: Translate, link: LinkState): Promise<boolean> {
  return new Promise((resolve) => {
    const look = (): void => {
      const lack = lackOfRoom(link.gates, measures(link.gates));
      if (lack) return draw(lack);
      window.removeEventListener("resize", look);
      resolve(true);
    };
    const draw = ({ reason, values }: GateFinding): void => {
      const actions = [{ label: t("try_again"), press: look }];
      if (link.screens_devices) actions.push({ label: t("no_device"), press: () => resolve(false) });
      showNotice(root, { title: t("window_small_title"), text: t(reason, values), actions, back: wayBack(t, link) });
    };
    window.addEventListener("resize", look);
    look();
  });
}
