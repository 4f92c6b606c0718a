/** One request to the server: an answer of any status, or a NetworkError where none came. */

export interface Answer {
  status: number;
  /** The JSON body, or null where the answer had none. */
  body: unknown;
  /** Seconds the server asks to wait before the next try, from Retry-After. */
  retry_after_s: number | null;
}

/** The server could not be reached, or did not answer in time. */
export class NetworkError extends Error {
  override name = "NetworkError";
}

/** The server refused: `code` and `message` come from its one error shape. */
export class Refused extends Error {
  override name = "Refused";
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
    readonly details: unknown,
  ) {
    super(message);
  }
}

export interface RequestOptions {
  token?: string | null;
  body?: unknown;
  timeout_ms?: number;
  base?: string;
}

export async function request(method: string, path: string, options: RequestOptions = {}): Promise<Answer> {
  const headers: Record<string, string> = { Accept: "application/json" };
  if (options.token) headers["Authorization"] = `Bearer ${options.token}`;
  if (options.body !== undefined) headers["Content-Type"] = "application/json";
  const init: RequestInit = { method, headers, cache: "no-store", signal: AbortSignal.timeout(options.timeout_ms ?? 10_000) };
  if (options.body !== undefined) init.body = JSON.stringify(options.body, storable);
  try {
    const response = await fetch((options.base ?? "") + path, init);
    const text = await response.text();
    const wait = Number(response.headers.get("Retry-After"));
    return { status: response.status, body: parsed(text), retry_after_s: wait > 0 ? wait : null };
  } catch (error) {
    throw new NetworkError(`${method} ${path}: ${String(error)}`);
  }
}

/** Text without the characters that no database stores: NUL, and halves of characters. */
function storable(_key: string, value: unknown): unknown {
  return typeof value === "string" ? value.replace(/\0/g, "").replace(/\p{Surrogate}/gu, "\uFFFD") : value;
}

function parsed(text: string): unknown {
  if (!text) return null;
  try {
    return JSON.parse(text);
  } catch {
    // A proxy sent an error page instead of JSON: its status says enough.
    return null;
  }
}

export function isTemporary(status: number): boolean {
  return status >= 500 || status === 408 || status === 425 || status === 429;
}

/** The server is there, and something else keeps its database: it says so by this code. */
export const BUSY = "database_busy";

export function refusalOf(answer: Answer): Refused {
  const body = answer.body as { error?: { code?: string; message?: string; details?: unknown } } | null;
  const error = body?.error;
  return new Refused(answer.status, error?.code ?? `http_${answer.status}`, error?.message ?? "", error?.details ?? null);
}

/** The body of a 2xx answer; a Refused for any other. */
export async function call<Body>(method: string, path: string, options: RequestOptions = {}): Promise<Body> {
  const answer = await request(method, path, options);
  if (answer.status >= 200 && answer.status < 300) return answer.body as Body;
  throw refusalOf(answer);
}

// For parts of the browser that may be blocked in such a way that they never answer.

class NoAnswerInTime extends Error {
  override name = "NoAnswerInTime";
}

/** What `work` gives, also where it throws at once; rejects where it does not settle in time. */
export function withinTime<Value>(work: () => Promise<Value>, limit_ms: number): Promise<Value> {
  return new Promise((resolve, reject) => {
    const limit = setTimeout(() => reject(new NoAnswerInTime(`the browser did not answer in ${limit_ms} ms`)), limit_ms);
    void (async () => work())()
      .then(resolve, reject)
      .finally(() => clearTimeout(limit));
  });
}
