import { useNavigate } from "@tanstack/react-router";
import { api, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";

/** Create a study and open it. */
export function useCreate(created?: () => void) {
  const navigate = useNavigate();
  return useChange((body: Schemas["NewStudy"]) => unwrap(api.POST("/api/admin/studies", { body })), {
    touches: [["studies"]],
    done: "The study is created, as a draft.",
    then: ({ summary }) => {
      created?.();
      void navigate({ to: `/studies/${summary.name}` });
    },
  });
}
