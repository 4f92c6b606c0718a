/** Boxes to tick, one or several of them. */
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import type { Control, FormField } from "./field";

type Options = Extract<FormField, { type: "choice" }>["options"];

/** The boxes, and the values of those that are ticked. */
export function ticked(options: Options, type: "radio" | "checkbox", language: string, name: string): [HTMLElement, () => string[]] {
  const inputs = options.map(({ value }) => h("input", { type, name, value }));
  const rows = options.map(({ label }, index) => h("label", { class: "tick" }, inputs[index], h("span", {}, pick(label, language))));
  const chosen = (): string[] => inputs.filter((input) => input.checked).map((input) => input.value);
  return [h("div", { class: "choices" }, ...rows), chosen];
}

/** A control of such boxes, which cannot be answered wrongly. */
export function boxes(node: HTMLElement, answer: Control["answer"]): Control {
  return { node, grouped: true, answer, fault: () => null };
}
