/** Where what the participant has said is kept until the server has acknowledged it. */

export interface OutboxItem {
  /** UUID made here. The server stores a rating under it once, however often it arrives. */
  id: string;
  run_id: string;
  token: string;
  kind: "write" | "event";
  method: "PUT" | "POST";
  path: string;
  body: unknown;
  /** Order of sending: grows over reloads. */
  sequence: number;
}

export interface OutboxStore {
  readonly durable: boolean;
  add(item: OutboxItem): Promise<void>;
  all(): Promise<OutboxItem[]>;
  remove(ids: string[]): Promise<void>;
  /** Take an item the server will never accept out of the way, and keep it with the reason. */
  refuse(item: OutboxItem, reason: string): Promise<void>;
}

/** For browsers that keep nothing. Not durable, so each write must be acknowledged before going on. */
export class MemoryStore implements OutboxStore {
  readonly durable = false;
  private readonly items = new Map<string, OutboxItem>();

  add(item: OutboxItem): Promise<void> {
    this.items.set(item.id, item);
    return Promise.resolve();
  }
  all(): Promise<OutboxItem[]> {
    return Promise.resolve([...this.items.values()].sort((a, b) => a.sequence - b.sequence));
  }
  remove(ids: string[]): Promise<void> {
    for (const id of ids) this.items.delete(id);
    return Promise.resolve();
  }
  refuse(item: OutboxItem): Promise<void> {
    this.items.delete(item.id);
    return Promise.resolve();
  }
}
