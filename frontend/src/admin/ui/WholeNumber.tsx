/** A whole number that a person types: out of range it is refused in one line, and never changed to another number. */
import { NumberInput } from "@mantine/core";

interface Range {
  min: number;
  max?: number | undefined;
  /** Whether it may be left empty. */
  optional?: boolean;
}

export type Typed = number | string;

/** What is wrong with it, in one line; null if it can be used. */
export function faultOf(value: Typed, { min, max, optional = false }: Range): string | null {
  if (value === "" && optional) return null;
  const number = typeof value === "number" ? value : Number.NaN;
  if (Number.isInteger(number) && number >= min && (max === undefined || number <= max)) return null;
  const expected = max === undefined ? `of ${min} or more` : `from ${min} to ${max}`;
  return `Expected a whole number ${expected}, got ${value === "" ? "nothing" : value}. Change it to continue.`;
}

interface Props extends Range {
  label: string;
  w: number;
  placeholder?: string;
  value: Typed;
  onChange: (value: Typed) => void;
}

export function WholeNumber({ label, w, placeholder = "", value, onChange, ...range }: Props) {
  const max = range.max === undefined ? {} : { max: range.max };
  return (
    <NumberInput
      label={label}
      placeholder={placeholder}
      w={w}
      min={range.min}
      {...max}
      clampBehavior="none"
      value={value}
      onChange={onChange}
      error={faultOf(value, range)}
    />
  );
}
