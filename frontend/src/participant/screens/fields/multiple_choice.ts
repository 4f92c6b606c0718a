/** Any of several options. */
import type { TypeOfField } from "./field";
import { boxes, ticked } from "./options";

export const type: TypeOfField<"multiple_choice"> = {
  control({ field, language, id }) {
    return boxes(...ticked(field.options, "checkbox", language, id));
  },
  simulated: ({ options }) => options.slice(0, 1).map((option) => option.value),
};
