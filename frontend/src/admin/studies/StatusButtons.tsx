import { Button, Group } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { launchChecksQuery } from "../queries";
import { keptWork, otherWork } from "../builder/kept";
import { ConfirmButton } from "../ui/ConfirmButton";
import { useChange } from "../ui/useChange";
import { onDemand } from "../ui/onDemand";
import { OpenedDialog } from "./OpenedDialog";

const BeforeOpening = onDemand(async () => (await import("./BeforeOpening")).BeforeOpening);

type Status = Schemas["StudySummary"]["status"];
const NEXT: Record<Status, Status[]> = { draft: ["pilot", "live"], pilot: ["draft", "live", "closed"], live: ["closed"], closed: ["live"] };
const WORDS: Record<Status, [label: string, question: string]> = {
  draft: ["Back to draft", "Participants can no longer begin; pilot data stay."],
  pilot: ["Open as pilot", "Participants can begin; their data are marked as pilot."],
  live: ["Set live", "Participants can begin and their data count. Changes from now on make new versions."],
  closed: ["Close", "Nobody can begin any more; those under way may finish."],
};

const isOpen = (status: Status) => status === "live" || status === "pilot";

export function StatusButtons({ summary }: { summary: Schemas["StudySummary"] }) {
  const [opened, setOpened] = useState(false);
  const path = { params: { path: { study: summary.name } } };
  const change = useChange(
    (status: Status) => unwrap(api.PUT("/api/admin/studies/{study}/status", { ...path, body: { revision: summary.revision, status } })),
    {
      touches: [["study", summary.name], ["studies"]],
      // The dialog with the link says so itself; a message in the corner would lie over it on a phone.
      done: ({ summary: { status } }) => (isOpen(status) ? null : "The status is changed."),
      then: (detail) => setOpened(isOpen(detail.summary.status)),
    },
  );
  // Loaded by what the dialog shows; the server refuses for the same reasons.
  const isBlocked = useQuery({ ...launchChecksQuery(summary.name), enabled: false }).data?.some(({ blocks }) => blocks) ?? false;
  const preview = useChange(
    () =>
      unwrap(
        api.POST("/api/admin/studies/{study}/links", {
          ...path,
          body: { kind: "preview", label: "preview", labels: [], count: 1, days: 1 },
        }),
      ),
    { touches: [], then: ([link]) => link && window.open(link.url, "_blank", "noopener") },
  );
  return (
    <Group gap="xs">
      <Button variant="default" onClick={() => preview.mutate(undefined)} loading={preview.isPending}>
        Preview as a participant
      </Button>
      {NEXT[summary.status].map((status) => (
        <ConfirmButton
          key={status}
          label={WORDS[status][0]}
          question={`${WORDS[status][1]}${keptWork(summary.name) === null && otherWork(summary.name).length === 0 ? "" : " The work in the builder is not saved and not part of it."}`}
          confirm={WORDS[status][0]}
          harmless={status !== "closed"}
          blocked={status === "live" && isBlocked}
          onConfirm={() => change.mutate(status)}
        >
          {isOpen(status) && <BeforeOpening study={summary.name} status={status} />}
        </ConfirmButton>
      ))}
      {opened && <OpenedDialog study={summary.name} onClose={() => setOpened(false)} />}
    </Group>
  );
}
