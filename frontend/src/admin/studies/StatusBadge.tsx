import { Badge } from "@mantine/core";
import type { Schemas } from "../api";

const COLOURS = { draft: "gray.7", pilot: "indigo.8", live: "teal.9", closed: "dark.4" };

export function StatusBadge({ status }: { status: Schemas["StudySummary"]["status"] }) {
  return <Badge color={COLOURS[status]}>{status}</Badge>;
}
