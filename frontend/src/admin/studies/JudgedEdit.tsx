/** What saving an edited definition would do to the answers that are there: said before it is saved. */

import { Alert, List } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "../api";

export function JudgedEdit({ name, toml }: { name: string; toml: string }) {
  const [settled] = useDebouncedValue(toml, 500);
  const { data } = useQuery({
    queryKey: ["study", name, "judged", settled],
    queryFn: () =>
      unwrap(api.POST("/api/admin/studies/{study}/versions/check", { params: { path: { study: name } }, body: { toml: settled } })),
    retry: false,
  });
  if (data === undefined || data.changes.length === 0) return null;
  return (
    <Alert color={data.begins_series ? "yellow" : "blue"} variant="light" title={title(data)} role="status">
      {effect(data)}
      <List size="sm" mt="xs">
        {data.changes.map((change) => (
          <List.Item key={change.path}>
            {change.text}
            {change.effect === "wording" ? " (wording)" : ""}
          </List.Item>
        ))}
      </List>
    </Alert>
  );
}

function title(edit: Schemas["JudgedEdit"]): string {
  if (edit.begins_series) return "Saving begins a new data series";
  return edit.series === edit.present_series ? "Answers may be pooled" : `Answers join series ${edit.series}`;
}

function effect(edit: Schemas["JudgedEdit"]): string {
  if (edit.begins_series)
    return `This changes what is measured. The runs of series ${edit.present_series} (${edit.runs}) stay as they are; further runs are of series ${edit.series}. Results, reports and analyses keep the two apart.`;
  if (edit.runs === 0) return "No run has been made yet.";
  return `Further runs are of series ${edit.series}, like those of its other versions.`;
}
