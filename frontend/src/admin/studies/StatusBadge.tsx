/** A study's status, and whom its design turns away. */

import { Badge, Text } from "@mantine/core";
import type { Schemas } from "../api";

const COLOURS = { draft: "gray.7", pilot: "indigo.8", live: "teal.9", closed: "dark.4" };

export function StatusBadge({ status }: { status: Schemas["StudySummary"]["status"] }) {
  return <Badge color={COLOURS[status]}>{status}</Badge>;
}

/** Devices that can take no part, said before somebody sends them a link. */
export function TurnedAway({ design }: { design: Schemas["DesignOut"] | undefined }) {
  return design?.turned_away ? <Text size="sm">{design.turned_away}</Text> : null;
}
