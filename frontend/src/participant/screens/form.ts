/** A declared questionnaire on one page. */
import type { Form } from "../../api/schema";
import { pick } from "../../i18n";
import { h } from "../../ui/element";
import { alertLine, button, showPage, statusLine } from "../../ui/page";
import { placed } from "../flow/placed";
import { plugin, OBJECT, STRING, type PluginClass } from "../jspsych";
import type { Session } from "../session";
import { typeOf } from "./fields/field";
import { keepDraft } from "./form-draft";
import { fieldView, type FieldView, type FormAnswers } from "./question";
import { isSaving, saveShown, setSaving, stopButton } from "./support";

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
    async act(display) {
      (await import("./fill-in")).fillIn(display);
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
  const mended = (): void => {
    if (!body.querySelector(".fault:not(:empty)")) alert.textContent = "";
  };
  body.addEventListener("input", mended);
  body.addEventListener("change", mended);
  const section = showPage(display, { title: pick(form.title, language), eyebrow, body: [body, alert, status], actions: [go] });
  section.append(stopButton(session));
}

function answersOf(views: FieldView[]): FormAnswers {
  return Object.fromEntries(views.map((view) => [view.name, view.answer()]));
}
