/**
 * The outbox: everything the participant says is kept first, then sent in order until it is acknowledged.
 *
 * `put` resolves when the item is kept. `receipt` resolves when the server has answered for good. Requests may
 * be repeated without harm, because the server stores each id once.
 */
import type { OutboxItem, OutboxStore } from "./store";
import { BUSY, isTemporary, refusalOf, request, type Answer, type Refused, withinTime } from "../request";
import type { Event as RunEvent } from "../../api/schema";
import { clockTime } from "../measured";

// How long to wait before the next try: doubling from half a second to 15 s, spread by a random quarter.

const FIRST_MS = 500;
const LONGEST_MS = 15_000;

export function backoff(failures: number, random: () => number = Math.random): number {
  const full = Math.min(LONGEST_MS, FIRST_MS * 2 ** Math.max(0, failures - 1));
  // Spread, or all who lost the server at one moment would come back at one moment.
  return full * (0.75 + 0.5 * random());
}

// What is sent next: the oldest write, alone; if there is none, events of one run together.

const events = "/api/run/events";
// As many as the server takes in one call.
const EVENTS_A_CALL = 100;

interface Batch {
  method: "PUT" | "POST";
  path: string;
  token: string;
  body: unknown;
  items: OutboxItem[];
}

export function nextBatch(queue: readonly OutboxItem[]): Batch | null {
  // Answers before events: a person who leaves loses what happened, not what was said.
  const write = queue.find((item) => item.kind === "write");
  if (write) return { method: write.method, path: write.path, token: write.token, body: write.body, items: [write] };
  const first = queue[0];
  if (!first) return null;
  // An earlier visit may have left events; they are sent with that visit's token.
  const items = queue.filter((item) => item.token === first.token).slice(0, EVENTS_A_CALL);
  return { method: "POST", path: events, token: first.token, body: { events: items.map((item) => item.body) }, items };
}

export type Outcome = { accepted: true; body: unknown } | { accepted: false; refused: Refused };
export interface Sent {
  id: string;
  receipt: Promise<Outcome>;
}
export interface OutboxState {
  /** Answers that the server has not acknowledged. */
  pending: number;
  failures: number;
  /** The last try reached a server that was busy: the connection is good. */
  busy: boolean;
}
type Send = (method: string, path: string, options: { token: string; body: unknown }) => Promise<Answer>;

export interface OutboxOptions {
  send?: Send;
  /** Waiting, so that tests need not wait. */
  pause?: (ms: number) => Promise<void>;
  disk_limit_ms?: number;
  onChange?: (state: OutboxState) => void;
  /** A write of this run was accepted; called before it is forgotten. */
  onAccepted?: (item: OutboxItem, body: unknown) => void;
  /** An item of this run was refused for good. */
  onRefused?: (refused: Refused) => void;
}

/** A disk that takes longer is as good as none. */
const DISK_LIMIT_MS = 5_000;
/** What a participant calls an answer: a rating or a form, whether or not it was refused; not the views of its clips. */
const isAnswer = ({ path, body }: OutboxItem): boolean =>
  ANSWERS.some((of) => path.startsWith(of) || (path === REFUSED && (body as { path?: string }).path?.startsWith(of)));
const ANSWERS = ["/api/run/ratings/", "/api/run/forms/"];
const REFUSED = "/api/run/refused";
/** Refusals that say something of the visit, not of the record: the page acts on them. */
const OF_THE_VISIT = ["run_unknown", "run_closed", "consent_missing", "rating_differs", "view_differs"];

/** The report of a record that the server, or something on the way, will never accept; null if there is nothing to report. */
function reportOf(item: OutboxItem, { status, code, message }: Refused): OutboxItem | null {
  const isRecord = item.path.startsWith("/api/run/ratings/") || item.path === "/api/run/views";
  // Where the token is refused (401), a report under the same token would be refused as well.
  if (!isRecord || status < 400 || status === 401 || OF_THE_VISIT.includes(code)) return null;
  const reason = { code: code.slice(0, 100), message: message.slice(0, 2000) };
  return { ...item, method: "POST", path: REFUSED, body: { id: item.id, path: item.path, status, ...reason, body: item.body } };
}

export class Outbox {
  private queue: OutboxItem[] = [];
  private readonly waiting = new Map<string, (outcome: Outcome) => void>();
  private sequence = 0;
  private failures = 0;
  private busy = false;
  private running = false;
  private stopped = false;
  /** The disk is full or was taken away: what is put from now on lives in memory, and must be acknowledged. */
  private storeFailed = false;
  private wake: () => void = () => {};
  private idle: (() => void)[] = [];
  private run: { run_id: string; token: string } | null = null;

  constructor(
    private readonly store: OutboxStore,
    private readonly options: OutboxOptions = {},
  ) {}

  get durable(): boolean {
    return this.store.durable && !this.storeFailed;
  }

  get state(): OutboxState {
    return { pending: this.queue.filter(isAnswer).length, failures: this.failures, busy: this.busy };
  }

  /** Take up what an earlier visit left unsent, and begin to send. */
  async open(run_id: string, token: string): Promise<void> {
    this.run = { run_id, token };
    const left: OutboxItem[] = [];
    await this.onDisk(async () => void left.push(...(await this.store.all())));
    // Beyond everything kept: what is said now must be sent after it, over any number of reloads.
    this.sequence = left.reduce((last, item) => Math.max(last, item.sequence), this.sequence);
    // A newer token of the same run replaces the one an item was kept with.
    this.queue = left.map((item) => (item.run_id === run_id ? { ...item, token } : item));
    void this.sendAll();
  }

  /** Keep one write; resolves when it is on disk. `id` is made here unless the path already carries one. */
  async put(method: "PUT" | "POST", path: string, body: unknown, id: string = crypto.randomUUID()): Promise<Sent> {
    // Before it is kept: the server's answer may come as soon as the item is queued.
    const receipt = new Promise<Outcome>((resolve) => this.waiting.set(id, resolve));
    await this.keep({ id, kind: "write", method, path, body });
    return { id, receipt };
  }

  async putEvent(event: { id: string }): Promise<void> {
    await this.keep({ id: event.id, kind: "event", method: "POST", path: events, body: event });
  }

  /** Paths of this run's writes that the server has not acknowledged. */
  unsent(): OutboxItem[] {
    return this.queue.filter((item) => item.kind === "write" && item.run_id === this.run?.run_id);
  }

  /** Resolves true when nothing is left to send, false after `limit_ms`. */
  drained(limit_ms = Infinity): Promise<boolean> {
    if (this.queue.length === 0) return Promise.resolve(true);
    return new Promise((resolve) => {
      const timer = limit_ms === Infinity ? undefined : setTimeout(() => resolve(false), limit_ms);
      this.idle.push(() => {
        clearTimeout(timer);
        resolve(true);
      });
    });
  }

  /** Try at once, for instance when the connection is back. */
  nudge(): void {
    this.wake();
    void this.sendAll();
  }

  stop(): void {
    this.stopped = true;
    this.wake();
  }

  private async keep(item: Pick<OutboxItem, "id" | "kind" | "method" | "path" | "body">): Promise<void> {
    if (!this.run) throw new Error("expected an open outbox, got one without a run; call open() first");
    this.sequence += 1;
    const kept: OutboxItem = { ...item, ...this.run, sequence: this.sequence };
    await this.onDisk(() => this.store.add(kept));
    // Only now, once the disk has it: a page that dies while it sends must find the record again.
    this.queue.push(kept);
    this.changed();
    void this.sendAll();
  }

  private async sendAll(): Promise<void> {
    // One request at a time: the server then gets answers in the order in which they were given.
    if (this.running || this.stopped) return;
    this.running = true;
    // Looked up again each time: an answer put meanwhile goes before the events that wait.
    for (let batch = this.next(); batch; batch = this.next()) {
      const wait_ms = await this.sendOne(batch);
      this.changed();
      if (wait_ms > 0) await this.pause(wait_ms);
    }
    this.running = false;
    if (this.queue.length === 0) this.idle.splice(0).forEach((resolve) => resolve());
  }

  private next(): Batch | null {
    return this.stopped ? null : nextBatch(this.queue);
  }

  /** Send one batch; returns how long to wait before the next. */
  private async sendOne(batch: Batch): Promise<number> {
    try {
      const send = this.options.send ?? request;
      const answer = await send(batch.method, batch.path, { token: batch.token, body: batch.body });
      if (isTemporary(answer.status)) return this.failed(answer.retry_after_s, refusalOf(answer).code === BUSY);
      this.failures = 0;
      // Any answer that is not temporary is for good, a refusal too: sending it again would block the queue behind it.
      await this.settle(batch, answer);
      return 0;
    } catch {
      // Whatever went wrong, the record is kept and tried again: an error let through would stop the outbox for good.
      return this.failed(null);
    }
  }

  private failed(retry_after_s: number | null, busy = false): number {
    this.failures += 1;
    this.busy = busy;
    // Never sooner than the server asked for, and not at once either where it asked for nothing.
    return Math.max(backoff(this.failures), (retry_after_s ?? 0) * 1000);
  }

  private async settle(batch: Batch, answer: Answer): Promise<void> {
    const accepted = answer.status >= 200 && answer.status < 300;
    const outcome: Outcome = accepted ? { accepted, body: answer.body } : { accepted, refused: refusalOf(answer) };
    const ids = new Set(batch.items.map((item) => item.id));
    // What cannot be removed is sent once more by the next visit, which does no harm.
    const own = batch.items.filter((item) => item.run_id === this.run?.run_id);
    if (outcome.accepted) own.forEach((item) => this.options.onAccepted?.(item, answer.body));
    const reports = outcome.accepted ? [] : batch.items.flatMap((item) => reportOf(item, outcome.refused) ?? []);
    if (outcome.accepted) await this.onDisk(() => this.store.remove([...ids]));
    // Under the id of the record, whose place the report takes: a page that dies in between loses neither.
    else if (reports.length > 0) for (const report of reports) await this.onDisk(() => this.store.add(report));
    else for (const item of batch.items) await this.onDisk(() => this.store.refuse(item, outcome.refused.code));
    // A report takes its record's place in the order of sending.
    this.queue = [...this.queue.filter((item) => !ids.has(item.id)), ...reports].sort((a, b) => a.sequence - b.sequence);
    for (const id of ids) {
      this.waiting.get(id)?.(outcome);
      this.waiting.delete(id);
    }
    if (!outcome.accepted && own.length > 0) this.options.onRefused?.(outcome.refused);
  }

  private async pause(ms: number): Promise<void> {
    const woken = new Promise<void>((resolve) => (this.wake = resolve));
    const sleep = this.options.pause ?? ((time) => new Promise<void>((resolve) => setTimeout(resolve, time)));
    // Whichever comes first: `nudge` and `stop` end the wait early.
    await Promise.race([sleep(ms), woken]);
  }

  /** Once it has failed, or has not answered in time, the disk is left alone: nobody waits for it at each answer. */
  private async onDisk(work: () => Promise<void>): Promise<void> {
    if (this.storeFailed) return;
    try {
      await withinTime(work, this.options.disk_limit_ms ?? DISK_LIMIT_MS);
    } catch (error) {
      console.warn("the browser keeps nothing any more", error);
      this.storeFailed = true;
    }
  }

  private changed(): void {
    this.options.onChange?.(this.state);
  }
}

// What happened on the page apart from the answers: kept and sent like them, after them.

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
