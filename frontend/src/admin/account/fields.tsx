/** The two fields of every form that asks who somebody is. */

import { PasswordInput, type PasswordInputProps, TextInput } from "@mantine/core";

interface Field {
  label: string;
  value: string;
  onChange: (value: string) => void;
}

export function NameField({ label, value, onChange }: Field) {
  return (
    <TextInput label={label} autoComplete="username" required value={value} onChange={(event) => onChange(event.currentTarget.value)} />
  );
}

type PasswordProps = Field & Omit<PasswordInputProps, "onChange" | "value"> & { fresh?: boolean };

/** `fresh`: a password to be chosen, not the present one. */
export function PasswordField({ onChange, fresh = false, ...rest }: PasswordProps) {
  const chosen = {
    description: "At least 12 characters; a few uncommon words in a row do well.",
    autoComplete: "new-password",
    minLength: 12,
  };
  return (
    <PasswordInput
      required
      {...(fresh ? chosen : { autoComplete: "current-password" })}
      {...rest}
      onChange={(event) => onChange(event.currentTarget.value)}
      visibilityToggleButtonProps={{ "aria-label": "Show the password" }}
    />
  );
}
