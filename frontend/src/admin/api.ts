/** The typed client of the server, the one shape of its refusals, and what pages ask more than once. */

import createClient from "openapi-fetch";
import type { components, paths } from "../api/schema";
import { queryOptions, useQuery } from "@tanstack/react-query";

// The typed client of the server, and the one shape of its refusals.

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

/** Codes that say no more than the status. */
const GENERAL = new Map([
  ["invalid", "Please change your entry"],
  ["validation_failed", "Please change your entry"],
  ["conflict", "Not possible at the moment"],
  ["not_found", "Not found"],
  ["not_allowed", "Not allowed"],
  ["offline", "No connection"],
]);

/** What a message about an error is headed: what was refused, in words; only a fault of the program has "gone wrong". */
export function titleOf(error: Error): string {
  if (!(error instanceof Refused) || error.status >= 500 || error.code === "unknown") return "Something went wrong";
  const words = error.code.replaceAll("_", " ");
  return GENERAL.get(error.code) ?? `${words.charAt(0).toUpperCase()}${words.slice(1)}`;
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

// What pages ask of the server more than once.

export const sessionQuery = queryOptions({
  queryKey: ["session"],
  queryFn: () => unwrap(api.GET("/api/admin/session")),
  staleTime: 30_000,
});

export const studiesQuery = queryOptions({ queryKey: ["studies"], queryFn: () => unwrap(api.GET("/api/admin/studies")) });

export const studyQuery = (study: string) =>
  queryOptions({
    queryKey: ["study", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}", { params: { path: { study } } })),
  });

export const sealQuery = (study: string) =>
  queryOptions({
    queryKey: ["study", study, "seal"],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/seal", { params: { path: { study } } })),
  });

export const launchChecksQuery = (study: string) =>
  queryOptions({
    queryKey: ["study", study, "launch-checks"],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/launch-checks", { params: { path: { study } } })),
  });

/** Every clip tried in this browser; its progress is under the key with "progress" at its end. */
export const clipCheckQuery = (study: string, version: number) =>
  queryOptions({
    queryKey: ["clip check", study, version],
    queryFn: async ({ client, signal, queryKey }) => {
      const clips = await client.query(clipsQuery(study));
      const { checkClips } = await import("./clips/examine");
      return checkClips(study, clips, (progress) => client.setQueryData([...queryKey, "progress"], progress), signal);
    },
    staleTime: Infinity,
    retry: false,
  });

export const clipsQuery = (study: string) =>
  queryOptions({
    queryKey: ["clips", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/clips", { params: { path: { study } } })),
    staleTime: 300_000,
  });

/** Whether the signed-in account has this right on a study. */
export function useMay(study: string, right: Schemas["StudySummary"]["rights"][number]): boolean {
  return useQuery(studyQuery(study)).data?.summary.rights.includes(right) ?? false;
}

export const workspacesQuery = queryOptions({ queryKey: ["workspaces"], queryFn: () => unwrap(api.GET("/api/admin/workspaces")) });

/** The workspaces in which the signed-in account may make studies. */
export function useOwnWorkspaces(): Schemas["MyWorkspace"][] {
  const mine = useQuery(sessionQuery).data?.workspaces ?? [];
  return mine.filter(({ role, second_factor_needed }) => role !== "viewer" && !second_factor_needed);
}
