/** Words, on one line or several. */
import { h } from "../../../ui/element";
import type { TypeOfField } from "./field";

const ONE_LINE = 120;

export const type: TypeOfField<"text"> = {
  control({ field: { max_length: maximum }, t, id }) {
    const node = maximum > ONE_LINE ? h("textarea", { id, rows: 3 }) : h("input", { id, type: "text", autocomplete: "off" });
    const fault = (): string | null => (node.value.length > maximum ? t("form_length", { maximum }) : null);
    return { node, grouped: false, answer: () => node.value.trim() || null, fault };
  },
  simulated: () => "simulated",
};
