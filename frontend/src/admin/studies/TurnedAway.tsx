import { Text } from "@mantine/core";
import type { Schemas } from "../api";

/** Devices that can take no part, said before somebody sends them a link. */
export function TurnedAway({ design }: { design: Schemas["DesignOut"] | undefined }) {
  return design?.turned_away ? <Text size="sm">{design.turned_away}</Text> : null;
}
