/** The few elements that the playground is made of. */

interface Range {
  min: number;
  max: number;
  step: number;
}

export function element<Name extends keyof HTMLElementTagNameMap>(name: Name, className: string, text = ""): HTMLElementTagNameMap[Name] {
  const made = document.createElement(name);
  if (className !== "") made.className = className;
  made.textContent = text;
  return made;
}

export function button(label: string, press: () => void): HTMLButtonElement {
  const made = element("button", "", label);
  made.type = "button";
  made.addEventListener("click", press);
  return made;
}

/** A control with its name before it. */
export function labelled(name: string, control: HTMLElement): HTMLLabelElement {
  const label = element("label", "playground-labelled");
  label.append(element("span", "", name), control);
  return label;
}

export function chooser<Choice extends string>(name: string, choices: readonly Choice[], take: (choice: Choice) => void): HTMLElement {
  const select = element("select", "");
  select.append(...choices.map((choice) => new Option(choice, choice)));
  select.addEventListener("change", () => {
    const chosen = choices[select.selectedIndex];
    if (chosen !== undefined) take(chosen);
  });
  return labelled(name, select);
}

/** A slider with its value beside it, and a way to set it from outside. */
export function slider(
  name: string,
  { min, max, step }: Range,
  value: number,
  take: (value: number) => void,
): { row: HTMLElement; set: (value: number) => void } {
  const input = element("input", "");
  const output = element("output", "");
  Object.assign(input, { type: "range", min: String(min), max: String(max), step: String(step) });
  const set = (now: number): void => {
    input.value = String(now);
    output.textContent = String(Math.round(now * 1000) / 1000);
  };
  set(value);
  input.addEventListener("input", () => {
    output.textContent = input.value;
    take(input.valueAsNumber);
  });
  const row = labelled(name, input);
  row.append(output);
  return { row, set };
}
