/** A page outside the timeline: gates, links that lead nowhere, another tab, trouble. It replaces everything. */
import { h, type Child } from "../../ui/element";
import { button, showPage } from "../../ui/page";

export interface Notice {
  title: string;
  text: string;
  more?: Child[];
  actions?: { label: string; press: () => void }[];
}

export function showNotice(root: HTMLElement, notice: Notice): HTMLElement {
  // jsPsych keeps its own element in the root; a new one takes its place and the old timeline ends unseen.
  const display = h("div", { class: "notice" });
  root.replaceChildren(display);
  root.classList.remove("jspsych-display-element");
  const buttons = (notice.actions ?? []).map(({ label, press }, place) => button(label, press, place ? "quiet" : "primary"));
  showPage(display, { title: notice.title, body: [h("p", { role: "alert" }, notice.text), ...(notice.more ?? [])], actions: buttons });
  return display;
}
