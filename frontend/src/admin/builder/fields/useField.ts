/** What every editor of a key needs: its value, its label and help, what is wrong with it, and the way to set it. */

import { keyName, labelOf, type Path, pathName, valueAt } from "../data";
import { helpOf } from "../help";
import { effectOf, resolved, type Schema } from "../schema";
import { useBuilderHere } from "../useBuilder";

export interface FieldProps {
  path: Path;
  schema: Schema;
  required?: boolean;
}

export function useField({ path, schema, required = false }: FieldProps) {
  const builder = useBuilderHere();
  const name = String(path.at(-1) ?? "");
  const measured = effectOf(keyName(path), builder.trialKind) === "measured";
  const help = helpOf(resolved(schema));
  return {
    value: valueAt(builder.data, path),
    fallback: resolved(schema).default,
    label: labelOf(name),
    help: `${help}${measured ? " A change begins a new data series." : ""}`.trim(),
    problem: builder.problems.find((one) => one.path === pathName(path))?.message ?? null,
    set: (value: unknown) => builder.set(path, value),
    required,
    builder,
  };
}
