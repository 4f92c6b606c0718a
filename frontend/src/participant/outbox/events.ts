/** What happened on the page beside the answers: kept and sent like them, after them. */
import type { Event as RunEvent } from "../../api/schema";
import { clockTime } from "../measured";
import type { Outbox } from "./outbox";

/** What the page reports; the server takes any word, so that an older page is still heard. */
export type EventType =
  | "heartbeat"
  | "focus_lost"
  | "fullscreen_left"
  | "clip_unavailable"
  | "unsupported"
  | "storage_blocked"
  | "offline"
  | "online"
  | "stage"
  | "clock_changed"
  | "second_tab"
  | "warning_shown";

export class EventLog {
  constructor(private readonly outbox: Outbox) {}

  add(type: EventType, data: Record<string, unknown> = {}): void {
    const event: RunEvent & { type: EventType } = { id: crypto.randomUUID(), type, at: clockTime(), data };
    // An event that cannot be kept must not stop the participant.
    this.outbox.putEvent(event).catch((error: unknown) => console.warn("an event could not be kept", type, error));
  }
}
