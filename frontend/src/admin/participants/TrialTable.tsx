/** Every play of a run: what was shown, frame by frame, and what was answered. */

import { Badge, Table, Text } from "@mantine/core";
import type { Schemas } from "../api";
import { fixed } from "../ui/format";

type Trial = Schemas["TimelineTrial"];
const COLOURS: Record<string, string> = { good: "teal.9", flagged: "yellow.9", failed: "red.9" };

export function TrialTable({ trials }: { trials: Trial[] }) {
  if (trials.length === 0) return <Text c="dimmed">No ratings.</Text>;
  return (
    <Table.ScrollContainer minWidth={760}>
      <Table verticalSpacing={3}>
        <Table.Thead>
          <Table.Tr>
            <Table.Th>Trial</Table.Th>
            <Table.Th>Clip</Table.Th>
            <Table.Th>Answer</Table.Th>
            <Table.Th>After</Table.Th>
            <Table.Th>Shown</Table.Th>
            <Table.Th>Frames</Table.Th>
            <Table.Th w={220}>Drawn in time</Table.Th>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {trials.map((trial) => (
            <Table.Tr key={`${String(trial.trial_index)}-${String(trial.play)}`}>
              <Table.Td className="number">
                {trial.trial_index}
                {trial.play > 1 && ` (play ${trial.play})`} {trial.kind !== "main" && <Badge variant="default">{trial.kind}</Badge>}
              </Table.Td>
              <Table.Td>{trial.cell === null ? "" : `${trial.cell} ${trial.exemplar ?? ""}`}</Table.Td>
              <Table.Td className="number">
                {trial.response ?? "–"}
                {trial.expected_response !== null && ` (asked for ${trial.expected_response})`}
              </Table.Td>
              <Table.Td className="number">{trial.rt === null ? "–" : `${fixed(trial.rt, 0)} ms`}</Table.Td>
              <Table.Td>
                <Badge color={COLOURS[trial.verdict] ?? "gray.7"} title={trial.verdict_rule}>
                  {trial.verdict}
                </Badge>
              </Table.Td>
              <Table.Td className="number">
                {trial.frames_drawn === null ? "–" : `${trial.frames_drawn}, ${trial.frames_missing ?? 0} missing`}
              </Table.Td>
              <Table.Td>{trial.drawn !== null && <Ticks drawn={trial.drawn} />}</Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}

/** One tick a drawn frame, on a line of time. */
function Ticks({ drawn }: { drawn: number[][] }) {
  const times = drawn.map((pair) => pair[1] ?? 0);
  const start = times[0] ?? 0;
  const length = Math.max(1, (times.at(-1) ?? 0) - start);
  return (
    <svg viewBox="0 0 220 12" width={220} height={12} role="img" aria-label={`${times.length} frames in ${length.toFixed(0)} ms`}>
      {times.map((time, place) => {
        const x = 1 + (218 * (time - start)) / length;
        return <line key={`${String(place)}`} x1={x} x2={x} y1={1} y2={11} stroke="currentColor" strokeWidth={1} />;
      })}
    </svg>
  );
}
