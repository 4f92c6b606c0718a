/** One of several options. */
import type { TypeOfField } from "./field";
import { boxes, ticked } from "./options";

export const type: TypeOfField<"choice"> = {
  control({ field, language, id }) {
    const [node, chosen] = ticked(field.options, "radio", language, id);
    return boxes(node, () => chosen()[0] ?? null);
  },
  simulated: ({ options }) => options[0]?.value ?? null,
};
