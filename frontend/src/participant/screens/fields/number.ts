/** A whole number within limits. */
import { h } from "../../../ui/element";
import { plainNumber } from "../../../ui/keys";
import type { TypeOfField } from "./field";

export const type: TypeOfField<"number"> = {
  control({ field: { minimum, maximum }, t, id }) {
    const node = h("input", { id, type: "text", inputmode: "numeric", autocomplete: "off", class: "short" });
    const answer = (): number | null => {
      const text = plainNumber(node.value);
      return text === "" ? null : Number(text);
    };
    const fault = (): string | null => {
      const value = answer();
      const good = value === null || (Number.isInteger(value) && value >= minimum && value <= maximum);
      return good ? null : t("form_number", { minimum, maximum });
    };
    return { node, grouped: false, answer, fault };
  },
  simulated: ({ minimum, maximum }) => Math.min(maximum, Math.max(minimum, 30)),
};
