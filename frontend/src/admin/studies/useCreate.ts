import { useNavigate } from "@tanstack/react-router";
import { api, Refused, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";

/** Create a study and open it; `taken` is told where another study has the name. */
export function useCreate(taken: (message: string) => void, created?: () => void) {
  const navigate = useNavigate();
  return useChange((body: Schemas["NewStudy"]) => unwrap(api.POST("/api/admin/studies", { body })), {
    touches: [["studies"]],
    done: "The study is created, as a draft.",
    refused: (error) => {
      if (!(error instanceof Refused) || error.code !== "name_taken") return false;
      taken(error.message);
      return true;
    },
    then: ({ summary }) => {
      created?.();
      void navigate({ to: `/studies/${summary.name}` });
    },
  });
}
