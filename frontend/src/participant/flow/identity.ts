/** Which visit this browser is in: one client id per link, so that starting twice gives the same run. */
import type { LinkState } from "../../api/schema";

const RECRUITER_KEYS = 20;
const LONGEST_KEY = 100;
const LONGEST_CODE = 60;
const UUID = /^[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}$/i;
const LONGEST_VALUE = 200;
const OWN_KEYS = new Set(["simulate", "lang"]);

/** Recruiter parameters of the address: PROLIFIC_PID, workerId and the like. */
export function recruiterQuery(search: string): Record<string, string> {
  const entries = [...new URLSearchParams(search)].filter(([key]) => !OWN_KEYS.has(key)).slice(0, RECRUITER_KEYS);
  return Object.fromEntries(entries.map(([key, value]) => [key.slice(0, LONGEST_KEY), value.slice(0, LONGEST_VALUE)]));
}

/** The recruiter's address with the parameters of this page's address in their places. */
export function filledIn(address: string, search: string): string {
  const query = recruiterQuery(search);
  return address.replace(/\{(\w+)\}/g, (_, name: string) => encodeURIComponent(query[name] ?? ""));
}

/** What this browser keeps of one link, and of one person where the address names one. */
export function storageKey(what: string, link_token: string, search: string): string {
  return `${what} ${link_token} ${JSON.stringify(recruiterQuery(search))}`;
}

export class Identity {
  private readonly key: string;
  private readonly storage: SafeStorage | null;
  private own: string | null = null;

  /** A preview belongs to its tab; people recruited by name share no run even on one computer. */
  constructor(
    link_token: string,
    kind: LinkState["kind"],
    private readonly search: string,
  ) {
    this.key = storageKey("palpebra", link_token, search);
    this.storage = storageOf(kind === "preview" ? "sessionStorage" : "localStorage");
  }

  get isKnown(): boolean {
    return this.read() !== null;
  }

  get isNamed(): boolean {
    return Object.keys(recruiterQuery(this.search)).length > 0;
  }

  /** True where this tab has shown the visit before: a reload is by the same person. */
  get isOfThisTab(): boolean {
    return storageOf("sessionStorage")?.getItem(`${this.key} tab`) === this.read();
  }

  /** Where it is full or blocked the next page asks again. */
  keepTab(): void {
    storageOf("sessionStorage")?.setItem(`${this.key} tab`, this.client_id());
  }

  client_id(): string {
    const known = this.read();
    if (known) return known;
    const fresh = uuid();
    // Where nothing is kept the visit lasts as long as this page.
    this.own = fresh;
    this.storage?.setItem(this.key, fresh);
    return fresh;
  }

  /** The resume code that was entered here: the visit belongs to another browser's client id. */
  get code(): string | null {
    return this.storage?.getItem(`${this.key} code`)?.slice(0, LONGEST_CODE) ?? null;
  }

  /** Where it is full or blocked the code is asked for again. */
  keepCode(code: string): void {
    this.storage?.setItem(`${this.key} code`, code);
  }

  forget(): void {
    this.own = null;
    this.storage?.removeItem(this.key);
    this.storage?.removeItem(`${this.key} code`);
  }

  private read(): string | null {
    const kept = this.storage?.getItem(this.key) ?? null;
    // What is kept may have been damaged: the server would refuse it for ever.
    return kept !== null && UUID.test(kept) ? kept : this.own;
  }
}

/** A random UUID; crypto.randomUUID is there in secure contexts only. */
function uuid(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  // Version 4 and variant 1 have their bits in bytes 6 and 8.
  const marked = bytes.map((byte, index) => (index === 6 ? (byte & 0x0f) | 0x40 : index === 8 ? (byte & 0x3f) | 0x80 : byte));
  return Array.from(marked, (byte) => byte.toString(16).padStart(2, "0"))
    .join("")
    .replace(/^(.{8})(.{4})(.{4})(.{4})/, "$1-$2-$3-$4-");
}

/** What is kept of a site, as far as the browser lets it be: its methods never throw. */
export type SafeStorage = Pick<Storage, "getItem" | "setItem" | "removeItem">;

/** Null where the browser has none, or denies it. What is full keeps nothing new. */
export function storageOf(name: "localStorage" | "sessionStorage"): SafeStorage | null {
  const attempt = <Value>(work: () => Value): Value | null => {
    try {
      return work();
    } catch {
      return null;
    }
  };
  // Deleted, as by an extension, it is undefined; its methods may be missing or denied one by one.
  const storage = attempt(() => window[name] as Storage | undefined);
  if (!storage) return null;
  return {
    getItem: (key) => attempt(() => storage.getItem(key)),
    setItem: (key, value) => void attempt(() => storage.setItem(key, value)),
    removeItem: (key) => void attempt(() => storage.removeItem(key)),
  };
}
