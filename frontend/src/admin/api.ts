/** The typed client of the server, and the one shape of its refusals. */

import createClient from "openapi-fetch";
import type { components, paths } from "../api/schema";

export const api = createClient<paths>({ baseUrl: "/" });

export type Schemas = components["schemas"];

/** The server refused: `code` is for programs, the message for people. */
export class Refused extends Error {
  override name = "Refused";
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
  ) {
    super(message);
  }
}

interface Outcome<T> {
  data?: T | undefined;
  error?: unknown;
  response: Response;
}

/** The data of an answer; a Refused with the server's sentence where it was refused. */
export async function unwrap<T>(asked: Promise<Outcome<T>>): Promise<T> {
  let outcome: Outcome<T>;
  try {
    outcome = await asked;
  } catch {
    throw new Refused(0, "offline", "The server cannot be reached. Check the connection and try again.");
  }
  if (outcome.response.ok) return outcome.data as T;
  const detail = errorDetail(outcome.error);
  if (detail?.code === "sign_in_again") signInAgain();
  const message = detail?.message ?? `The server answered ${outcome.response.status}.`;
  throw new Refused(outcome.response.status, detail?.code ?? "unknown", message);
}

/** The event by which the page asks for a password again; what was typed on the page stays. */
export const SIGN_IN_AGAIN = "palpebra-sign-in-again";

function signInAgain(): void {
  window.dispatchEvent(new Event(SIGN_IN_AGAIN));
}

function errorDetail(body: unknown): { code: string; message: string } | null {
  if (typeof body !== "object" || body === null || !("error" in body)) return null;
  const { error } = body;
  if (typeof error !== "object" || error === null || !("code" in error) || !("message" in error)) return null;
  return { code: String(error.code), message: String(error.message) };
}
