/** Answers of a simulated participant: valid, and plain. */
import type { FormField } from "./fields";
import type { FieldAnswer } from "./fields";

export function simulatedAnswer(field: FormField): FieldAnswer {
  switch (field.type) {
    case "text":
      return "simulated";
    case "number":
      return Math.min(field.maximum, Math.max(field.minimum, 30));
    case "likert":
      return Math.ceil(field.points / 2);
    case "choice":
      return field.options[0]?.value ?? null;
    case "multiple_choice":
      return field.options.slice(0, 1).map((option) => option.value);
  }
}

/** Fill in a shown form: text and numbers typed, the first option of each question ticked. */
export function fillIn(display: HTMLElement): void {
  const named = new Set<string>();
  for (const input of display.querySelectorAll<HTMLInputElement | HTMLTextAreaElement>("input, textarea")) {
    if (input.type !== "radio" && input.type !== "checkbox") input.value = input.inputMode === "numeric" ? "30" : "simulated";
    else if (!named.has(input.name)) input.click();
    named.add(input.name);
  }
}
