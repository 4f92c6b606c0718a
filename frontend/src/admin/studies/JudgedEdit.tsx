/** What saving an edited definition would do to the answers that are there: said before it is saved. */

import { Alert, List } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "../api";
import { counted } from "../ui/format";

export function JudgedEdit({ detail, toml }: { detail: Schemas["StudyDetail"]; toml: string }) {
  const { name } = detail.summary;
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
      {effect(data, detail)}
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

/** What happens to the answers that are there once a new data series begins, in sentences. */
export function consequence(edit: Schemas["JudgedEdit"], { series, definition }: Schemas["StudyDetail"]): string {
  const present = series.find(({ number }) => number === edit.present_series);
  const people = present?.runs["participant"] ?? 0;
  const raters = people > 0 ? counted(people, "participant") : counted(edit.runs, "run");
  // The ends of a scale are what its answers mean.
  const { trial } = definition;
  const scale = trial.kind === "clip_rating" && edit.changes.some(({ path }) => path.startsWith("trial.scale")) ? trial.scale : null;
  const on = scale !== null && "minimum" in scale && "maximum" in scale ? ` on ${scale.minimum}-${scale.maximum}` : "";
  const kept = present === undefined ? `series ${edit.present_series}` : present.name;
  return `${raters} answered${on}. A new data series begins with this version (series ${edit.series}): the answers so far stay separate, in ${kept}. Results, reports and analyses keep the two apart.`;
}

/** Where the runs are if the present series has none. */
function elsewhere({ series }: Schemas["StudyDetail"], present: number): string {
  const total = (runs: Record<string, number>) => Object.values(runs).reduce((sum, number) => sum + number, 0);
  return series
    .filter(({ number, runs }) => number !== present && total(runs) > 0)
    .map(({ name, runs }) => `${counted(total(runs), "run is", "runs are")} in ${name}`)
    .join("; ");
}

function effect(edit: Schemas["JudgedEdit"], detail: Schemas["StudyDetail"]): string {
  if (edit.begins_series) return `This changes what is measured. ${consequence(edit, detail)}`;
  if (edit.runs === 0) {
    const others = elsewhere(detail, edit.present_series);
    return others === "" ? "No run has been made yet." : `Series ${edit.present_series} has no runs yet; ${others}.`;
  }
  return `Further runs are of series ${edit.series}, like those of its other versions.`;
}
