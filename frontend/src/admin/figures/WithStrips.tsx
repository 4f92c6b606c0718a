/** What needs the characters' pictures, once they are known; where they are not made, how to make them. */

import { Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import type { ReactNode } from "react";
import { api, type Schemas, unwrap } from "../api";

export const stripAddress = (character: string): string => `/api/admin/blinks/strips/${encodeURIComponent(character)}.webp`;

export function WithStrips({ children }: { children: (strips: Schemas["Strips"]) => ReactNode }) {
  const strips = useQuery({
    queryKey: ["strips"],
    queryFn: () => unwrap(api.GET("/api/admin/blinks/strips")),
    staleTime: Number.POSITIVE_INFINITY,
  });
  if (strips.data === undefined) return null;
  if (strips.data.characters.length > 0) return children(strips.data);
  return (
    <Text size="sm" c="dimmed">
      The characters' pictures are not on this server; <code>make run</code> makes them, or <code>stimuli strips</code>.
    </Text>
  );
}
