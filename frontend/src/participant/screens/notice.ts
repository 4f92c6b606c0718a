/** A page outside the timeline: gates, links that lead nowhere, another tab, trouble. It replaces everything. */
import { h, type Child } from "../../ui/element";
import { button, showPage } from "../../ui/page";

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
