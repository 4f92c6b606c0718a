/** What was filled in of a form and not sent yet: kept in this tab, so that a reload does not lose it. */
import { storageOf } from "../flow/identity";

type Input = HTMLInputElement | HTMLTextAreaElement;
type Draft = (string | boolean)[];

const inputsOf = (form: HTMLElement): Input[] => [...form.querySelectorAll<Input>("input, textarea")];
const isBox = (input: Input): input is HTMLInputElement => input.type === "radio" || input.type === "checkbox";

/** Fill the form in as it was left, and keep what is changed from now on. */
export function keepDraft(form: HTMLElement, run_id: string, name: string): { forget: () => void } {
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
