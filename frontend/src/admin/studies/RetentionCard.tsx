/** How long the study's data of persons are kept, and what the server will erase. */

import { Card, List, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { counted, when } from "../ui/format";

type Preview = Schemas["RetentionPreview"];

const WHAT: Record<Preview["periods"][number]["what"], string> = {
  identifiers: "Who took part (recruiters’ ids, parameters of addresses, completion codes, labels of personal links)",
  unfinished: "Visits that were not completed, answers and all",
  answers: "Every visit, answers and all",
};

export function RetentionCard({ study }: { study: string }) {
  const preview = useQuery({
    queryKey: ["study", study, "retention"],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/retention", { params: { path: { study } } })),
  });
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        How long data are kept
      </Title>
      <Answer of={preview}>{(data) => (data.periods.length > 0 ? <Declared preview={data} /> : <Undeclared preview={data} />)}</Answer>
    </Card>
  );
}

function Declared({ preview }: { preview: Preview }) {
  return (
    <>
      <List size="sm" mb="sm">
        {preview.periods.map(({ what, days }) => (
          <List.Item key={what}>
            {WHAT[what]}: {days} {days === 1 ? "day" : "days"} after the last sign of life
          </List.Item>
        ))}
      </List>
      <Coming preview={preview} />
    </>
  );
}

function Undeclared({ preview }: { preview: Preview }) {
  return (
    <>
      <Text size="sm">
        No period is declared: data stay until somebody erases them. Declare one under “Keeping and handing on” of the design.
      </Text>
      <Coming preview={preview} />
    </>
  );
}

function Coming({ preview }: { preview: Preview }) {
  const due = preview.identifiers + preview.visits;
  if (due === 0 && preview.next_at === null) return null;
  return (
    <Text size="sm" mt="xs">
      {due > 0 &&
        `Within the hour the server erases ${counted(preview.visits, "visit")}, and who took part in ${String(preview.identifiers)} more. `}
      {preview.next_at !== null && `The next is due ${when(preview.next_at)}.`}
    </Text>
  );
}
