import { Text } from "@mantine/core";

/** Why a button cannot be pressed: what has to be given before. */
export function StillNeeded({ parts }: { parts: readonly (string | false)[] }) {
  const needed = parts.filter((part) => part !== false);
  if (needed.length === 0) return null;
  return (
    <Text size="sm" role="status">
      Still needed: {needed.join(", ")}.
    </Text>
  );
}
