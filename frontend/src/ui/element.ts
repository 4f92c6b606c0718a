/** The parts that a page is made of: elements, pages with a heading and buttons, and progress bars. */

// Builds DOM elements. Text always enters as text nodes, so nothing a person typed can become markup.

export type Child = Node | string | number | null | undefined | false;
type Listener = (event: Event) => void;
export type Attributes = Record<string, string | number | boolean | null | undefined | Listener>;

export function h<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[Tag] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) setAttribute(element, name, value);
  append(element, children);
  return element;
}

function setAttribute(element: Element, name: string, value: Attributes[string]): void {
  if (typeof value === "function") element.addEventListener(name.replace(/^on/, ""), value);
  else if (value === false || value === null || value === undefined) element.removeAttribute(name);
  else element.setAttribute(name, value === true ? "" : String(value));
}

function append(parent: Element, children: Child[]): void {
  for (const child of children) {
    if (child === null || child === undefined || child === false) continue;
    parent.append(typeof child === "number" ? String(child) : child);
  }
}

let counter = 0;
/** An id no other element of this page has, for labels and descriptions. */
export function uniqueId(stem: string): string {
  counter += 1;
  return `${stem}-${counter}`;
}

// The frame of every screen but the trial: a heading, what there is to read or do, and the way on.

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

// A progress bar that does not move by itself: a ruler with one tick per part.

export interface ProgressBar {
  element: HTMLElement;
  set(done: number, total: number): void;
}

export function progressBar(label: string): ProgressBar {
  const bar = h("progress", { "aria-label": label, max: 1, value: 0 });
  return {
    element: bar,
    set(done, total) {
      bar.max = Math.max(1, total);
      bar.value = done;
    },
  };
}
