/** The editor of one key of the declaration, chosen by its schema. */

import { editorOf } from "../schema";
import { Choice, Flag, Lists, Numeric, OneText, Raw, Translated, Words } from "./scalars";
import { Dictionary, Numbers, Translations } from "./lines";
import { ByLanguage, Elements, Table, Variants } from "./tables";
import type { FieldProps } from "./useField";

export function Field(props: FieldProps) {
  switch (editorOf(props.schema).kind) {
    case "constant":
      return null;
    case "flag":
      return <Flag {...props} />;
    case "number":
      return <Numeric {...props} />;
    case "choice":
      return <Choice {...props} />;
    case "text":
      return <OneText {...props} />;
    case "translated":
      return <Translated {...props} />;
    case "words":
      return <Words {...props} />;
    case "numbers":
      return <Numbers {...props} />;
    case "lists":
      return <Lists {...props} />;
    case "translations":
      return <Translations {...props} />;
    case "dictionary":
      return <Dictionary {...props} />;
    case "table":
      return <Table {...props} />;
    case "variants":
      return <Variants {...props} />;
    case "elements":
      return <Elements {...props} />;
    case "languages":
      return <ByLanguage {...props} />;
    case "raw":
      return <Raw {...props} />;
  }
}
