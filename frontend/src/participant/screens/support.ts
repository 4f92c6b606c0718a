/** What screens share: notices, choices, saving with what is shown meanwhile, and the button to stop. */
import { h, button, type Child, showPage } from "../../ui/element";
import { clickNothing, isStartKey, listenKeys } from "../../ui/keys";
import type { Outcome } from "../outbox/outbox";
import type { Session } from "../session";

// What several screens need: a way to wait for one press, to save with a word about it, and to stop.

const SLOW_MS = 400;
const OFFLINE_MS = 4_000;
const LOOK_MS = 500;

/** A signal for listeners of one screen: ends with `done`, and with the whole visit. */
export function screenSignal(session: Session): { signal: AbortSignal; done: () => void } {
  const own = new AbortController();
  return { signal: AbortSignal.any([own.signal, session.over.signal]), done: () => own.abort() };
}

export interface Choice<Value> {
  label: string;
  value: Value;
  kind?: "primary" | "quiet" | "plain";
}

/**
 * Buttons for `choices`; resolves with the one pressed. Enter presses the first where no field has the focus, and so does
 * Space: always, where it is alone and in sight, or never, as on a break, which a press by habit would skip.
 */
export function choose<Value>(
  session: Session,
  footer: HTMLElement,
  choices: Choice<Value>[],
  space: "always" | "alone" | "never" = "alone",
): Promise<Value> {
  const { signal, done } = screenSignal(session);
  return new Promise((resolve) => {
    const take = (value: Value): void => {
      done();
      resolve(value);
    };
    const buttons = choices.map(({ label, value, kind }, index) => button(label, () => take(value), kind ?? (index ? "quiet" : "primary")));
    footer.append(...buttons);
    const [first] = buttons;
    listenKeys((event) => {
      if (!first || !isStartKey(event)) return;
      if (event.key === " " && (space === "never" || (space === "alone" && (choices.length > 1 || !isInSight(first))))) return;
      clickNothing(event);
      first.click();
    }, signal);
  });
}

/** False where Space has still to scroll to it, as it does on every page that is read. */
function isInSight(element: Element): boolean {
  return element.getBoundingClientRect().bottom <= window.innerHeight;
}

/** What keeps answers from the server, in a word: it was not reached, or is busy; empty where it has answered or was not tried yet. */
export function trouble({ outbox, t }: Pick<Session, "outbox" | "t">): string {
  const { failures, busy } = outbox.state;
  if (failures === 0 && navigator.onLine) return "";
  // What is not on this device must not be called safe there.
  if (!outbox.durable) return t("saving_in_page");
  return t(busy ? "saving_busy" : "saving_offline");
}

/** Wait for what must be with the server before the page goes on, and say so where it takes long: nothing else moves meanwhile. */
export async function waitShown<Value>(session: Session, work: Promise<Value>): Promise<Value> {
  const line = h("p", { class: "waiting", role: "status" });
  const began = performance.now();
  const timer = setInterval(() => {
    if (!line.isConnected) session.root.append(line);
    if (performance.now() - began > SLOW_MS) say(line, trouble(session) || session.t("saving"));
  }, LOOK_MS);
  try {
    return await work;
  } finally {
    clearInterval(timer);
    line.remove();
  }
}

/** Wait for the server's answer to a write and say so in `status` where it takes long. */
export async function saveShown(session: Session, status: HTMLElement, saving: Promise<Outcome>): Promise<Outcome> {
  const began = performance.now();
  const timer = setInterval(() => {
    const waited = performance.now() - began;
    const why = waited > OFFLINE_MS ? trouble(session) : "";
    if (waited > SLOW_MS) say(status, why || session.t("saving"));
  }, LOOK_MS);
  const outcome = await saving;
  clearInterval(timer);
  status.textContent = outcome.accepted ? "" : session.t("not_saved", { message: outcome.refused.message });
  return outcome;
}

/** A button whose press is being saved. It stays enabled for the browser: a disabled one loses the focus to the page. */
export function setSaving(go: HTMLButtonElement, saving: boolean): void {
  go.setAttribute("aria-disabled", String(saving));
}

export const isSaving = (go: HTMLButtonElement): boolean => go.getAttribute("aria-disabled") === "true";

/** Change a line only where it says something else: what is written again may be spoken again. */
function say(line: HTMLElement, text: string): void {
  if (line.textContent !== text) line.textContent = text;
}

/** Where the study screens devices: the choice for people without a larger window or screen. */
export function noDevice<Value>(session: Session, value: Value): Choice<Value>[] {
  return session.link.screens_devices ? [{ label: session.t("no_device"), value, kind: "plain" }] : [];
}

/** Ask the server to end the run; its answer changes the page. Never resolves. */
export async function screenOut(session: Session, reason: string, data: object): Promise<never> {
  await session.outbox.put("POST", "/api/run/screen-out", { reason, data });
  return new Promise(() => {});
}

/** The resume code and what it is for; empty where the link itself resumes. */
export function codeNote({ run, t }: Pick<Session, "run" | "t">): string {
  return run.resume_code ? t("resume_note", { code: run.resume_code }) : "";
}

/** The quiet way out, in the corner of pages between the trials. */
export function stopButton(session: Session): HTMLElement {
  return h(
    "div",
    { class: "corner" },
    button(session.t("stop"), () => void session.root.dispatchEvent(new CustomEvent("stop")), "plain"),
  );
}

// A page outside the timeline: gates, links that lead nowhere, another tab, trouble. It replaces everything.

/** Where the recruiter wants those who take no part, and what leads there. */
export type Back = { label: string; href: string } | null;

export interface Notice {
  title: string;
  text: string;
  more?: Child[];
  back?: Back;
  actions?: { label: string; press: () => void }[];
}

/** A fresh place in the root. jsPsych's own element goes, and with it whatever its timeline still shows. */
export function emptied(root: HTMLElement): HTMLElement {
  const display = h("div", { class: "notice" });
  root.replaceChildren(display);
  return display;
}

export function showNotice(root: HTMLElement, notice: Notice): HTMLElement {
  const display = emptied(root);
  const { back } = notice;
  const leads = back ? h("a", { class: "button quiet", href: back.href, rel: "noreferrer" }, back.label) : null;
  const buttons = (notice.actions ?? []).map(({ label, press }, index) => button(label, press, index ? "quiet" : "primary"));
  showPage(display, {
    title: notice.title,
    body: [h("p", { role: "alert" }, notice.text), ...(notice.more ?? [])],
    actions: [...buttons, leads],
  });
  return display;
}
