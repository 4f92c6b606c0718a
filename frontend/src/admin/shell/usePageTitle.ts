/** What the browser's tab says: the page, and the study that it is of. */

import { useDocumentTitle } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { studyQuery } from "../queries";

const PAGES: Record<string, string> = {
  "": "Studies",
  new: "New study",
  blinks: "Blinks",
  labelling: "Label video",
  "blink-review": "Review blinks",
  people: "People",
  workspaces: "Workspaces",
  backups: "Backups",
  audit: "Audit log",
  account: "My account",
};

export function usePageTitle(pathname: string): void {
  const [first = "", study = "", tab = "design", run, part] = pathname.split("/").slice(1);
  const isStudy = first === "studies" && study !== "" && study !== "new";
  const title = useQuery({ ...studyQuery(study), enabled: isStudy }).data?.summary.title ?? study;
  const page = `${(tab || "design").charAt(0).toUpperCase()}${(tab || "design").slice(1)}`;
  const words = isStudy
    ? [run === undefined ? page : `${part === "replay" ? "Replay of run" : "Run"} ${run.slice(0, 8)}`, title]
    : [PAGES[study === "new" ? "new" : first] ?? "Not found"];
  useDocumentTitle([...words, "Palpebra"].join(" – "));
}
