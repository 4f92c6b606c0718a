import { useQueryClient } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import type { Schemas } from "../api";
import { sessionQuery } from "../queries";

/** What happens once the server knows who somebody is: the session is kept, the page asked for opens. */
export function useEntered(next = "/") {
  const navigate = useNavigate();
  const queries = useQueryClient();
  return (me: Schemas["Me"]) => {
    queries.setQueryData(sessionQuery.queryKey, me);
    void navigate({ to: next });
  };
}
