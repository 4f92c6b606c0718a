import { useNavigate } from "@tanstack/react-router";
import { api, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";

/** Create a study and open it. */
export function useCreate() {
  const navigate = useNavigate();
  return useChange((body: Schemas["NewStudy"]) => unwrap(api.POST("/api/admin/studies", { body })), {
    touches: [["studies"]],
    done: "The study is created, as a draft.",
    then: ({ summary }) => void navigate({ to: `/studies/${summary.name}` }),
  });
}

/** Send files; the server looks into each and says what it is. */
export async function uploadFiles(files: readonly File[]): Promise<Schemas["UploadOut"]> {
  const form = new FormData();
  for (const file of files) form.append("files", file);
  return unwrap(api.POST("/api/admin/uploads", { body: { files: [] }, bodySerializer: () => form }));
}
