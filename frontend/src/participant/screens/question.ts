/** The questions of a form: each with its label, its help and the control of its type, and what is wrong with the answer. */
import { pick, type Translate } from "../../i18n";
import { h, uniqueId, type Child } from "../../ui/element";
import { typeOf, type FieldAnswer, type FormField } from "./fields/field";

export type FormAnswers = Record<string, FieldAnswer>;
export interface FieldView {
  name: string;
  element: HTMLElement;
  answer(): FieldAnswer;
  /** Show what is wrong with the answer; null where nothing is. */
  check(): string | null;
  focus(): void;
}

export function fieldView(field: FormField, language: string, t: Translate): FieldView {
  const ids = { control: uniqueId("field"), help: uniqueId("help"), fault: uniqueId("fault") };
  const control = typeOf(field).control({ field, language, t, id: ids.control });
  const fault = h("p", { class: "fault", id: ids.fault });
  const help = field.help ? h("p", { class: "help", id: ids.help }, pick(field.help, language)) : null;
  const label: Child[] = [pick(field.label, language), field.required && h("span", { class: "needed" }, t("form_required"))];
  const described = `${help ? ids.help : ""} ${ids.fault}`.trim();
  const element = control.grouped
    ? h("fieldset", { class: "field", "aria-describedby": described }, h("legend", {}, ...label), help, control.node, fault)
    : h("div", { class: "field" }, h("label", { for: ids.control }, ...label), help, control.node, fault);
  if (!control.grouped) control.node.setAttribute("aria-describedby", described);
  const inputs = (): HTMLElement[] => [...element.querySelectorAll<HTMLElement>("input, textarea")];
  const check = (): string | null => {
    const answer = control.answer();
    const empty = answer === null || (Array.isArray(answer) && answer.length === 0);
    const text = control.fault() ?? (empty && field.required ? t("form_missing") : null);
    fault.textContent = text ?? "";
    inputs().forEach((input) => (text ? input.setAttribute("aria-invalid", "true") : input.removeAttribute("aria-invalid")));
    return text;
  };
  // What was marked is looked at again with each change, and only that: nobody is corrected while still writing.
  const changed = (): void => {
    if (fault.textContent) check();
  };
  element.addEventListener("input", changed);
  element.addEventListener("change", changed);
  return { name: field.name, element, answer: control.answer, check, focus: () => inputs()[0]?.focus() };
}
