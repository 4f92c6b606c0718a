/** The questions of a form: each kind of field as an accessible control that knows its answer and its fault. */
import type { Form } from "../../api/schema";
import { pick, type Translate } from "../../i18n";
import { h, uniqueId, type Child } from "../../ui/element";

export type FormField = Form["fields"][number];
export type FieldAnswer = string | number | string[] | null;
export type FormAnswers = Record<string, FieldAnswer>;
export interface FieldView {
  name: string;
  element: HTMLElement;
  answer(): FieldAnswer;
  /** Show what is wrong with the answer; null where nothing is. */
  check(): string | null;
  focus(): void;
}
interface Control {
  node: HTMLElement;
  grouped: boolean;
  answer: () => FieldAnswer;
  fault: () => string | null;
}

export function fieldView(field: FormField, language: string, t: Translate): FieldView {
  const ids = { control: uniqueId("field"), help: uniqueId("help"), fault: uniqueId("fault") };
  const control = controlOf(field, language, t, ids.control);
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

function controlOf(field: FormField, language: string, t: Translate, id: string): Control {
  switch (field.type) {
    case "text":
      return textControl(field.max_length, t, id);
    case "number":
      return numberControl(field.minimum, field.maximum, t, id);
    case "likert":
      return likertControl(field.points, pick(field.low, language), pick(field.high, language), id);
    default: {
      const options = field.options.map((option) => ({ value: option.value, label: pick(option.label, language) }));
      return choiceControl(options, field.type === "multiple_choice", id);
    }
  }
}

function textControl(maximum: number, t: Translate, id: string): Control {
  const node = maximum > 120 ? h("textarea", { id, rows: 3 }) : h("input", { id, type: "text", autocomplete: "off" });
  const fault = (): string | null => (node.value.length > maximum ? t("form_length", { maximum }) : null);
  return { node, grouped: false, answer: () => node.value.trim() || null, fault };
}

function numberControl(minimum: number, maximum: number, t: Translate, id: string): Control {
  const node = h("input", { id, type: "text", inputmode: "numeric", autocomplete: "off", class: "short" });
  const answer = (): number | null => (node.value.trim() === "" ? null : Number(node.value.trim()));
  const fault = (): string | null => {
    const value = answer();
    const good = value === null || (Number.isInteger(value) && value >= minimum && value <= maximum);
    return good ? null : t("form_number", { minimum, maximum });
  };
  return { node, grouped: false, answer, fault };
}

function choiceControl(options: { value: string; label: string }[], several: boolean, name: string): Control {
  const inputs = options.map(({ value }) => h("input", { type: several ? "checkbox" : "radio", name, value }));
  const rows = options.map(({ label }, place) => h("label", { class: "tick" }, inputs[place], h("span", {}, label)));
  const chosen = (): string[] => inputs.filter((input) => input.checked).map((input) => input.value);
  const answer = (): FieldAnswer => (several ? chosen() : (chosen()[0] ?? null));
  return { node: h("div", { class: "choices" }, ...rows), grouped: true, answer, fault: () => null };
}

function likertControl(points: number, low: string, high: string, name: string): Control {
  const inputs = Array.from({ length: points }, (_, place) => h("input", { type: "radio", name, value: place + 1 }));
  const steps = inputs.map((input, place) => h("label", { class: "step" }, input, h("span", {}, place + 1)));
  const node = h(
    "div",
    { class: "likert" },
    h("span", { class: "end" }, low),
    h("div", { class: "steps" }, ...steps),
    h("span", { class: "end" }, high),
  );
  const answer = (): number | null => Number(inputs.find((input) => input.checked)?.value ?? 0) || null;
  return { node, grouped: true, answer, fault: () => null };
}
