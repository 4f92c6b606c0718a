/** Where the outbox keeps its items: in memory, or in the browser's IndexedDB. */

// Where what the participant has said is kept until the server has acknowledged it.

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

// The outbox on disk: a write counts as kept only when its IndexedDB transaction is complete.

const DATABASE = "palpebra";
const VERSION = 1;

export class IndexedDbStore implements OutboxStore {
  readonly durable = true;
  private constructor(private readonly database: IDBDatabase) {}

  /** Open the database, or reject where the browser keeps nothing (private window, blocked, full). */
  static open(factory: IDBFactory = indexedDB): Promise<IndexedDbStore> {
    return new Promise((resolve, reject) => {
      const opening = factory.open(DATABASE, VERSION);
      opening.onupgradeneeded = () => createStores(opening.result);
      opening.onsuccess = () => resolve(new IndexedDbStore(opening.result));
      opening.onerror = () => reject(opening.error ?? new Error("IndexedDB could not be opened"));
      opening.onblocked = () => reject(new Error("IndexedDB is held by an older page"));
    });
  }

  add(item: OutboxItem): Promise<void> {
    return this.write(["outbox"], (stores) => stores("outbox").put(item));
  }

  async all(): Promise<OutboxItem[]> {
    const reading = this.database.transaction("outbox").objectStore("outbox").getAll() as IDBRequest<OutboxItem[]>;
    const items = await new Promise<OutboxItem[]>((resolve, reject) => {
      reading.onsuccess = () => resolve(reading.result);
      reading.onerror = () => reject(failure(reading.error));
    });
    // The store is keyed by id: its order is not that of sending.
    return items.sort((a, b) => a.sequence - b.sequence);
  }

  remove(ids: string[]): Promise<void> {
    return this.write(["outbox"], (stores) => ids.forEach((id) => stores("outbox").delete(id)));
  }

  refuse(item: OutboxItem, reason: string): Promise<void> {
    return this.write(["outbox", "refused"], (stores) => {
      // In one transaction: a crash in between may neither lose the record nor send it for ever.
      stores("refused").put({ ...item, reason });
      stores("outbox").delete(item.id);
    });
  }

  private write(names: string[], work: (stores: (name: string) => IDBObjectStore) => void): Promise<void> {
    return new Promise((resolve, reject) => {
      // "strict": the disk has it before the page says so; a crash of the machine then loses nothing either.
      const transaction = this.database.transaction(names, "readwrite", { durability: "strict" });
      transaction.oncomplete = () => resolve();
      transaction.onerror = () => reject(failure(transaction.error));
      // A full disk aborts without an error event.
      transaction.onabort = () => reject(failure(transaction.error));
      work((name) => transaction.objectStore(name));
    });
  }
}

function failure(error: DOMException | null): Error {
  return error ?? new Error("IndexedDB gave up without a reason");
}

function createStores(database: IDBDatabase): void {
  database.createObjectStore("outbox", { keyPath: "id" });
  database.createObjectStore("refused", { keyPath: "id" });
}
