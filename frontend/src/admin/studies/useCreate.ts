import { useNavigate } from "@tanstack/react-router";
import { api, Refused, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";

const isTaken = (error: Error | null) => error instanceof Refused && error.code === "name_taken";

/** Why no study was made, but for its name; null where that is not so. */
export const refusal = (error: Error | null): string | null => (error === null || isTaken(error) ? null : error.message);

/**
 * Create a study and open it; `taken` is told where another study has the name.
 * @param told whether the page itself tells of every other refusal
 */
export function useCreate(taken: (message: string) => void, created?: () => void, told = false) {
  const navigate = useNavigate();
  return useChange((body: Schemas["NewStudy"]) => unwrap(api.POST("/api/admin/studies", { body })), {
    touches: [["studies"]],
    done: "The study is created, as a draft.",
    refused: (error) => {
      if (!isTaken(error)) return told;
      taken(error.message);
      return true;
    },
    then: ({ summary }) => {
      created?.();
      void navigate({ to: `/studies/${summary.name}` });
    },
  });
}
