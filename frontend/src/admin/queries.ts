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

export const clipsQuery = (study: string) =>
  queryOptions({
    queryKey: ["clips", study],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/clips", { params: { path: { study } } })),
    staleTime: 300_000,
  });

const RANK = { viewer: 0, experimenter: 1, owner: 2 };

/** Whether the signed-in account has at least this role. */
export function useMay(role: Schemas["AccountOut"]["role"]): boolean {
  const { data } = useQuery(sessionQuery);
  const mine = data?.account?.role;
  return mine !== undefined && RANK[mine] >= RANK[role];
}
