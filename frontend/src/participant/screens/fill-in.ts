/** Fill in a shown form: text and numbers typed, the first option of each question ticked. */
export function fillIn(display: HTMLElement): void {
  const named = new Set<string>();
  for (const input of display.querySelectorAll<HTMLInputElement | HTMLTextAreaElement>("input, textarea")) {
    if (input.type !== "radio" && input.type !== "checkbox") input.value = input.inputMode === "numeric" ? "30" : "simulated";
    else if (!named.has(input.name)) input.click();
    named.add(input.name);
  }
}
