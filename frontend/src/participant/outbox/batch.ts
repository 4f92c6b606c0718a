/** What is sent next: the oldest write by itself; where there is none, events of one run together. */
import type { OutboxItem } from "./store";

export const events = "/api/run/events";
const EVENTS_A_CALL = 100;

export interface Batch {
  method: "PUT" | "POST";
  path: string;
  token: string;
  body: unknown;
  items: OutboxItem[];
}

export function nextBatch(queue: readonly OutboxItem[]): Batch | null {
  const write = queue.find((item) => item.kind === "write");
  if (write) return { method: write.method, path: write.path, token: write.token, body: write.body, items: [write] };
  const first = queue[0];
  if (!first) return null;
  const items = queue.filter((item) => item.token === first.token).slice(0, EVENTS_A_CALL);
  return { method: "POST", path: events, token: first.token, body: { events: items.map((item) => item.body) }, items };
}
