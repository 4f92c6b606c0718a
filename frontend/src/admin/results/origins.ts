/** Whose answers are shown together: never those of two origins. */

export type DataOrigin = "participant" | "pilot" | "simulated";

export const ORIGINS: { value: DataOrigin; label: string }[] = [
  { value: "participant", label: "Participants" },
  { value: "pilot", label: "Pilot" },
  { value: "simulated", label: "Simulated" },
];

export function labelOfOrigin(word: string): string {
  return ORIGINS.find((origin) => origin.value === word)?.label ?? word;
}

export function originOf(word: string): DataOrigin {
  return ORIGINS.find((origin) => origin.value === word)?.value ?? "participant";
}
