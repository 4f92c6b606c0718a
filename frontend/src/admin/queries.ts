/** What pages ask of the server more than once. */

import { queryOptions, useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "./api";

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
