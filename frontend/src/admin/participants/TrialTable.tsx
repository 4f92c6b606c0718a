/** Every play of a run: what was shown, frame by frame, and what was answered. */

import { Anchor, Badge } from "@mantine/core";
import { Link, useParams } from "@tanstack/react-router";
import type { Schemas } from "../api";
import { type Column, DataTable } from "../ui/DataTable";
import { fixed } from "../ui/format";
import { ruleWords } from "../ui/play-words";
import { VERDICT_COLOURS } from "../ui/verdicts";

type Trial = Schemas["TimelineTrial"];

const COLUMNS: Column<Trial>[] = [
  {
    title: "Trial",
    number: true,
    cell: (trial) => (
      <>
        <ReplayLink trial={trial.trial_index} />
        {trial.play > 1 && ` (play ${trial.play})`}{" "}
        {trial.kind !== "main" && (
          <Badge variant="default" size="sm">
            {trial.kind}
          </Badge>
        )}
      </>
    ),
  },
  { title: "Clip", wrap: true, cell: (trial) => (trial.cell === null ? "–" : `${trial.cell} ${trial.exemplar ?? ""}`) },
  {
    title: "Answer",
    number: true,
    cell: (trial) => `${given(trial)}${trial.expected_response === null ? "" : ` (asked for ${trial.expected_response})`}`,
  },
  { title: "After", number: true, wide: true, cell: (trial) => (trial.rt === null ? "–" : `${fixed(trial.rt, 0)} ms`) },
  {
    title: "Shown",
    cell: (trial) => (
      <Badge color={VERDICT_COLOURS[trial.verdict] ?? "gray.7"} size="sm" title={ruleWords(trial.verdict_rule)}>
        {trial.verdict}
      </Badge>
    ),
  },
  {
    title: "Frames",
    number: true,
    wide: true,
    cell: (trial) => (trial.frames_drawn === null ? "–" : `${trial.frames_drawn}, ${trial.frames_missing ?? 0} missing`),
  },
  { title: "Each frame drawn", wide: true, cell: (trial) => (trial.drawn === null ? "–" : <Ticks drawn={trial.drawn} />) },
];

/** The trial's number, which leads to its replay. */
function ReplayLink({ trial }: { trial: number }) {
  const { study = "", run = "" } = useParams({ strict: false });
  return (
    <Anchor
      component={Link}
      to={`/studies/${study}/participants/${run}/replay`}
      search={{ trial } as never}
      title={`Replay trial ${trial}`}
    >
      {trial}
    </Anchor>
  );
}

/** The one number, or what was answered on each scale. */
function given({ response, answer }: Trial): string {
  const answers = answer["answers"];
  if (typeof answers !== "object" || answers === null) return String(response ?? "–");
  return Object.entries(answers as Record<string, { response: number | null; not_applicable?: boolean }>)
    .map(([scale, one]) => `${scale} ${one.response ?? (one.not_applicable ? "not applicable" : "–")}`)
    .join(", ");
}

export function TrialTable({ trials }: { trials: Trial[] }) {
  return (
    <DataTable
      dense
      rows={trials}
      rowKey={(trial) => `${String(trial.trial_index)}-${String(trial.play)}`}
      columns={COLUMNS}
      empty="No ratings."
    />
  );
}

/** One tick a drawn frame, on a line of time. */
function Ticks({ drawn }: { drawn: number[][] }) {
  const times = drawn.map((pair) => pair[1] ?? 0);
  const start = times[0] ?? 0;
  const length = Math.max(1, (times.at(-1) ?? 0) - start);
  return (
    <svg viewBox="0 0 220 12" width={220} height={12} role="img" aria-label={`${times.length} frames in ${length.toFixed(0)} ms`}>
      {times.map((time, index) => {
        const x = 1 + (218 * (time - start)) / length;
        return <line key={index} x1={x} x2={x} y1={1} y2={11} stroke="currentColor" strokeWidth={1} />;
      })}
    </svg>
  );
}
