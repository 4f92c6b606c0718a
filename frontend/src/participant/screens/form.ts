/** A declared questionnaire on one page. */
import { storageOf } from "../flow/identity";
import { pick, type Translate } from "../../i18n";
import { h, uniqueId, type Child, alertLine, button, showPage, statusLine } from "../../ui/element";
import { typeOf, type FieldAnswer, type FormField } from "./fields/field";
import type { Form } from "../../api/schema";
import { placed, type Session } from "../session";
import { plugin, OBJECT, STRING, type PluginClass } from "../jspsych";
import { isSaving, saveShown, setSaving, stopButton } from "./support";

/** Fill in a shown form: text and numbers typed, the first option of each question ticked. */
function fillIn(display: HTMLElement): void {
  const named = new Set<string>();
  for (const input of display.querySelectorAll<HTMLInputElement | HTMLTextAreaElement>("input, textarea")) {
    if (input.type !== "radio" && input.type !== "checkbox") input.value = input.inputMode === "numeric" ? "30" : "simulated";
    else if (!named.has(input.name)) input.click();
    named.add(input.name);
  }
}

// What was filled in of a form and not sent yet: kept in this tab, so that a reload does not lose it.

type Input = HTMLInputElement | HTMLTextAreaElement;
type Draft = (string | boolean)[];

const inputsOf = (form: HTMLElement): Input[] => [...form.querySelectorAll<Input>("input, textarea")];
const isBox = (input: Input): input is HTMLInputElement => input.type === "radio" || input.type === "checkbox";

/** Fill the form in as it was left, and keep what is changed from now on. */
function keepDraft(form: HTMLElement, run_id: string, name: string): { forget: () => void } {
  const storage = storageOf("sessionStorage");
  const key = `palpebra form ${run_id} ${name}`;
  const inputs = inputsOf(form);
  restore(inputs, storage?.getItem(key) ?? null);
  const keep = (): void => {
    const draft: Draft = inputs.map((input) => (isBox(input) ? input.checked : input.value));
    storage?.setItem(key, JSON.stringify(draft));
  };
  form.addEventListener("input", keep);
  form.addEventListener("change", keep);
  return { forget: () => storage?.removeItem(key) };
}

function restore(inputs: Input[], kept: string | null): void {
  const draft = parsed(kept);
  // Another form by this name, as of a newer version of the study, begins empty.
  if (draft?.length !== inputs.length) return;
  inputs.forEach((input, index) => {
    const value = draft[index];
    if (isBox(input)) input.checked = value === true;
    else if (typeof value === "string") input.value = value;
  });
}

function parsed(kept: string | null): Draft | null {
  try {
    const draft: unknown = JSON.parse(kept ?? "null");
    return Array.isArray(draft) ? (draft as Draft) : null;
  } catch {
    return null;
  }
}

// The questions of a form: each with its label, its help and the control of its type, and what is wrong with the answer.

type FormAnswers = Record<string, FieldAnswer>;
interface FieldView {
  name: string;
  element: HTMLElement;
  answer(): FieldAnswer;
  /** Show what is wrong with the answer; null where nothing is. */
  check(): string | null;
  focus(): void;
}

function fieldView(field: FormField, language: string, t: Translate): FieldView {
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

interface Parameters {
  eyebrow: string;
  form: Form;
}
interface Data {
  answers: FormAnswers;
}

export function formPage(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "form",
    parameters: {
      eyebrow: STRING, // small line above the title
      form: OBJECT, // the declared form
    },
    data: { answers: OBJECT }, // answers by field name, null where left open
    show: (display, { form, eyebrow }) => new Promise((resolve) => showForm(session, display, form, eyebrow, resolve)),
    async simulate({ form }) {
      const answers = Object.fromEntries(form.fields.map((field) => [field.name, typeOf(field).simulated(field)]));
      const outcome = await session.api.form(form.name, answers);
      if (outcome.accepted) placed(session.run, outcome.body);
      return { answers };
    },
    act(display) {
      fillIn(display);
      display.querySelector<HTMLButtonElement>(".primary")?.click();
    },
  });
}

function showForm(session: Session, display: HTMLElement, form: Form, eyebrow: string, done: (data: Data) => void): void {
  const { t, language } = session;
  const views = form.fields.map((field) => fieldView(field, language, t));
  const [alert, status] = [alertLine(), statusLine()];
  const go = button(t("continue"), () => {
    if (isSaving(go)) return;
    const bad = views.filter((view) => view.check() !== null);
    alert.textContent = bad.length ? t("form_fix") : "";
    if (bad.length) return bad[0]?.focus();
    setSaving(go, true);
    const answers = answersOf(views);
    void saveShown(session, status, session.api.form(form.name, answers)).then((outcome) => {
      if (!outcome.accepted) return setSaving(go, false);
      draft.forget();
      placed(session.run, outcome.body);
      done({ answers });
    });
  });
  const body = h(
    "form",
    {
      class: "form",
      novalidate: true,
      onsubmit: (event) => {
        event.preventDefault();
        go.click();
      },
    },
    ...views.map((view) => view.element),
  );
  const draft = keepDraft(body, session.run.run_id, form.name);
  const clearFault = (): void => {
    if (!body.querySelector(".fault:not(:empty)")) alert.textContent = "";
  };
  body.addEventListener("input", clearFault);
  body.addEventListener("change", clearFault);
  const section = showPage(display, { title: pick(form.title, language), eyebrow, body: [body, alert, status], actions: [go] });
  section.append(stopButton(session));
}

function answersOf(views: FieldView[]): FormAnswers {
  return Object.fromEntries(views.map((view) => [view.name, view.answer()]));
}
