/** A rating with labeled ends. */
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import type { TypeOfField } from "./field";

export const type: TypeOfField<"likert"> = {
  control({ field: { points, low, high }, language, id: name }) {
    const inputs = Array.from({ length: points }, (_, index) => h("input", { type: "radio", name, value: index + 1 }));
    const steps = inputs.map((input, index) => h("label", { class: "step" }, input, h("span", {}, index + 1)));
    const node = h(
      "div",
      { class: "likert" },
      h("span", { class: "end" }, pick(low, language)),
      h("div", { class: "steps" }, ...steps),
      h("span", { class: "end" }, pick(high, language)),
    );
    const answer = (): number | null => Number(inputs.find((input) => input.checked)?.value ?? 0) || null;
    return { node, grouped: true, answer, fault: () => null };
  },
  simulated: ({ points }) => Math.ceil(points / 2),
};
