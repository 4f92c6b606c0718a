/** Which visit this browser is in: a client id a link, so that starting twice gives the same run. */
import type { LinkDocument } from "../../api/participant";

const RECRUITER_KEYS = 20;
const LONGEST_VALUE = 200;
const OWN_KEYS = new Set(["simulate", "lang"]);

/** Recruiter parameters of the address: PROLIFIC_PID, workerId and the like. */
export function recruiterQuery(search: string): Record<string, string> {
  const entries = [...new URLSearchParams(search)].filter(([key]) => !OWN_KEYS.has(key)).slice(0, RECRUITER_KEYS);
  return Object.fromEntries(entries.map(([key, value]) => [key.slice(0, LONGEST_VALUE), value.slice(0, LONGEST_VALUE)]));
}

export class Identity {
  private readonly key: string;
  private readonly storage: Storage | null;
  private own: string | null = null;

  /** A preview belongs to its tab; people recruited by name share no run even on one computer. */
  constructor(link_token: string, kind: LinkDocument["kind"], private readonly search: string) {
    this.key = `palpebra ${link_token} ${JSON.stringify(recruiterQuery(search))}`;
    this.storage = storageOf(kind === "preview" ? "sessionStorage" : "localStorage");
  }

  get isKnown(): boolean {
    return this.read() !== null;
  }

  get isNamed(): boolean {
    return Object.keys(recruiterQuery(this.search)).length > 0;
  }

  client_id(): string {
    const known = this.read();
    if (known) return known;
    const fresh = crypto.randomUUID();
    this.own = fresh;
    try {
      this.storage?.setItem(this.key, fresh);
    } catch {
      // Full or blocked: the visit then lasts as long as this page.
    }
    return fresh;
  }

  forget(): void {
    this.own = null;
    this.storage?.removeItem(this.key);
  }

  private read(): string | null {
    try {
      return this.storage?.getItem(this.key) ?? this.own;
    } catch {
      return this.own;
    }
  }
}

function storageOf(name: "localStorage" | "sessionStorage"): Storage | null {
  try {
    return window[name];
  } catch {
    return null;
  }
}
