/** The frame of every screen but the trial: a heading, what there is to read or do, and the way on. */
import { h, uniqueId, type Child } from "./element";

export interface PageParts {
  title?: string;
  /** Small line above the title: where in the study this is. */
  eyebrow?: string | undefined;
  body: Child[];
  actions?: Child[];
  /** Wide pages hold pictures; others keep a readable line length. */
  wide?: boolean;
}

/** Show a page in `display` and give its heading the focus, so that screen readers begin there. */
export function showPage(display: HTMLElement, parts: PageParts): HTMLElement {
  const title = parts.title ? h("h1", {}, parts.title) : null;
  const section = h(
    "section",
    { class: parts.wide ? "page page-wide" : "page" },
    parts.eyebrow && h("p", { class: "eyebrow" }, parts.eyebrow),
    title,
    ...parts.body,
    parts.actions && h("footer", { class: "actions" }, ...parts.actions),
  );
  display.replaceChildren(section);
  focusHeading(section);
  return section;
}

export function focusHeading(section: HTMLElement): void {
  const heading = section.querySelector("h1") ?? section.querySelector("h2");
  if (!heading) return;
  heading.id ||= uniqueId("heading");
  heading.tabIndex = -1;
  section.setAttribute("aria-labelledby", heading.id);
  heading.focus({ preventScroll: true });
  window.scrollTo(0, 0);
}

export function button(label: string, onclick: () => void, kind: "primary" | "quiet" | "plain" = "primary"): HTMLButtonElement {
  return h("button", { type: "button", class: `button ${kind}`, onclick }, label);
}

/** A line that screen readers speak when it changes. */
export function statusLine(): HTMLParagraphElement {
  return h("p", { class: "status", role: "status" });
}

/** A line for what went wrong; spoken at once. */
export function alertLine(): HTMLParagraphElement {
  return h("p", { class: "alert", role: "alert" });
}
