/** What happened on the page beside the answers: kept and sent like them, after them. */
import type { EventType, RunEvent } from "../../api/participant";
import type { Outbox } from "./outbox";

export class EventLog {
  constructor(private readonly outbox: Outbox) {}

  add(type: EventType, data: Record<string, unknown> = {}): void {
    const event: RunEvent = { id: crypto.randomUUID(), type, at: new Date().toISOString(), data };
    // An event that cannot be kept must not stop the participant.
    this.outbox.putEvent(event).catch((error: unknown) => console.warn("an event could not be kept", type, error));
  }
}
