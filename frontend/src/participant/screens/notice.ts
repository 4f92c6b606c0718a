/** A page outside the timeline: gates, links that lead nowhere, another tab, trouble. It replaces everything. */
import { h, type Child } from "../../ui/element";
import { button, showPage } from "../../ui/page";

export interface Notice {
  title: string;
  text: string;
  more?: Child[];
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
  const buttons = (notice.actions ?? []).map(({ label, press }, place) => button(label, press, place ? "quiet" : "primary"));
  showPage(display, { title: notice.title, body: [h("p", { role: "alert" }, notice.text), ...(notice.more ?? [])], actions: buttons });
  return display;
}
