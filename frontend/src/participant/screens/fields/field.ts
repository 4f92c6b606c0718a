/** What a type of field gives: its control, and the answer of a simulated participant. A file of its name here, found by the name. */
import type { Form } from "../../../api/schema";
import type { Translate } from "../../../i18n";

export type FormField = Form["fields"][number];
export type FieldAnswer = string | number | string[] | null;
export interface Control {
  node: HTMLElement;
  /** Whether the node holds several inputs, which one question names. */
  grouped: boolean;
  answer: () => FieldAnswer;
  fault: () => string | null;
}
interface Ask<Field> {
  field: Field;
  language: string;
  t: Translate;
  id: string;
}
interface FieldType<Field> {
  control(ask: Ask<Field>): Control;
  /** A valid answer, and a plain one. */
  simulated(field: Field): FieldAnswer;
}
/** The type of field whose declaration has this `type`. */
export type TypeOfField<Name extends FormField["type"]> = FieldType<Extract<FormField, { type: Name }>>;

const files = import.meta.glob<FieldType<FormField>>(["./*.ts", "!./field.ts", "!./options.ts"], { import: "type", eager: true });

export function typeOf(field: FormField): FieldType<FormField> {
  const type = files[`./${field.type}.ts`];
  if (!type) throw new Error(`expected a field this page knows, got ${field.type}; load the page again`);
  return type;
}
