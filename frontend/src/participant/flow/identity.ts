/** Which visit this browser is in: a client id a link, so that starting twice gives the same run. */
import type { LinkState } from "../../api/schema";

const RECRUITER_KEYS = 20;
const LONGEST_KEY = 100;
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
  private readonly storage: Storage | null;
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

  /** True where this tab has shown the visit before: who reloads it is the same person. */
  get isOfThisTab(): boolean {
    try {
      return storageOf("sessionStorage")?.getItem(`${this.key} tab`) === this.read();
    } catch {
      return false;
    }
  }

  keepTab(): void {
    try {
      storageOf("sessionStorage")?.setItem(`${this.key} tab`, this.client_id());
    } catch {
      // Full or blocked: the next page asks again.
    }
  }

  client_id(): string {
    const known = this.read();
    if (known) return known;
    const fresh = uuid();
    this.own = fresh;
    try {
      this.storage?.setItem(this.key, fresh);
    } catch {
      // Full or blocked: the visit then lasts as long as this page.
    }
    return fresh;
  }

  /** The resume code that was entered here: the visit belongs to another browser's client id. */
  get code(): string | null {
    try {
      return this.storage?.getItem(`${this.key} code`) ?? null;
    } catch {
      return null;
    }
  }

  keepCode(code: string): void {
    try {
      this.storage?.setItem(`${this.key} code`, code);
    } catch {
      // Full or blocked: the code is then asked for again.
    }
  }

  forget(): void {
    this.own = null;
    this.storage?.removeItem(this.key);
    this.storage?.removeItem(`${this.key} code`);
  }

  private read(): string | null {
    try {
      return this.storage?.getItem(this.key) ?? this.own;
    } catch {
      return this.own;
    }
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

export function storageOf(name: "localStorage" | "sessionStorage"): Storage | null {
  try {
    return window[name];
  } catch {
    return null;
  }
}
